"""Finds what a verb does; nothing heavy is imported before it is known that it will run."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Sequence
from importlib import import_module

from eqs.commands.configured import CONFIGURED, run_configured
from eqs.commands.help_page import configured_page, purpose
from eqs.extras import needed

# Verbs with a command line of their own: module below eqs.commands, and what they do.
PLAIN = {
    "info": "Say what an event file of any kind holds.",
    "convert": "Convert an event file of any kind, with its frames, to the layout of DSEC.",
    "view": "Show an event file as a GIF, an MP4 or a strip of stills.",
    "watch": "Film what a trained detector finds.",
    "benchmark": "Time simulators, score, detector, interpolation, or reading for a training.",
    "fetch-interpolator": "Fetch the weights of a network that makes frames in between.",
    "compare": "Compare trainings: accuracy over wall time, and how their settings differ.",
}
HELP = ("-h", "--help")


def main() -> None:
    """The command `eqs`: the verb comes first."""
    verb, *arguments = sys.argv[1:] or ["--help"]
    if verb in HELP:
        sys.stdout.write(overview())
    elif verb in CONFIGURED or verb in PLAIN:
        run(verb, arguments, shown=f"eqs {verb}")
    else:
        near = difflib.get_close_matches(verb, [*CONFIGURED, *PLAIN], n=1) or ["--help"]
        sys.exit(
            f"Expected one of {', '.join([*CONFIGURED, *PLAIN])}, got {verb}; type eqs {near[0]}"
        )


def run(verb: str, arguments: Sequence[str] | None = None, shown: str | None = None) -> None:
    """Do what one verb does.

    Args:
        verb: which.
        arguments: what follows it on the command line; those of the process if None.
        shown: how the command was typed; by default `python` and the script.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    shown = shown or f"python {sys.argv[0]}"
    try:
        _run(verb, arguments, shown)
    except KeyboardInterrupt:  # before or after the work, which says more about itself
        sys.stderr.write("\ninterrupted; type the same command again\n")
        sys.exit(130)


def _run(verb: str, arguments: Sequence[str], shown: str) -> None:
    if verb in PLAIN:
        try:
            with needed("all", f"for eqs {verb}"):
                command = import_module(f"eqs.commands.{verb.replace('-', '_')}")
        except ValueError as error:
            sys.exit(str(error))
        command.main(arguments, shown)
    elif any(each in HELP for each in arguments):
        sys.stdout.write(configured_page(CONFIGURED[verb].config, shown))
    else:
        run_configured(verb, arguments)


def overview() -> str:
    """What `eqs` alone prints."""
    verbs = {verb: purpose(command.config) for verb, command in CONFIGURED.items()} | PLAIN
    width = max(map(len, verbs)) + 2
    lines = [f"  {verb:<{width}}{text}" for verb, text in verbs.items()]
    return "\n".join(
        [
            "How real is simulated event-camera data, and does it matter to a detector?",
            "",
            *lines,
            "",
            "`eqs VERB --help` shows what can be chosen.",
            "",
        ]
    )
