"""Verbs that Hydra configures: what is typed becomes a configuration, and a pipeline gets it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from eqs.commands.quoting import is_path, with_quoted_path
from eqs.extras import needed

if TYPE_CHECKING:
    from omegaconf import DictConfig

CONFIGS = Path(__file__).parents[1] / "configs"
# Options of Hydra that the next argument belongs to.
WITH_VALUE = (
    "--config-dir",
    "-cd",
    "--config-path",
    "-cp",
    "--config-name",
    "-cn",
    "--package",
    "-p",
)


def as_typed(arguments: Sequence[str]) -> list[str]:
    """Nothing to translate."""
    return list(arguments)


def with_flags(arguments: Sequence[str]) -> list[str]:
    """Flags as the keys they stand for, wherever they are typed; behind Hydra's own, like -m."""
    flags = {"--eqs": "score=true", "--sanity": "sanity=true"}
    others = [argument for argument in arguments if argument not in flags]
    return [*others, *(flags[argument] for argument in arguments if argument in flags)]


def with_files(arguments: Sequence[str]) -> list[str]:
    """The first two plain arguments as the files they name, simulated and real."""
    names = iter(("simulated", "real"))
    translated = []
    for before, argument in zip(("", *arguments), arguments, strict=False):
        named = "=" not in argument or is_path(argument)  # names of files may have an = in them
        plain = named and not argument.startswith("-") and before not in WITH_VALUE
        name = next(names, None) if plain else None
        translated.append(f"{name}={argument}" if name else argument)
    return translated


@dataclass(frozen=True, kw_only=True)
class Configured:
    """A verb that Hydra configures.

    Args:
        config: its configuration, a file of `eqs/configs`.
        module: module below `eqs.pipelines` with its pipeline.
        pipeline: the function that gets the configuration.
        translate: turns what is typed into what Hydra reads, which is only `key=value`.
    """

    config: str
    module: str
    pipeline: str
    translate: Callable[[Sequence[str]], list[str]] = as_typed


CONFIGURED = {
    "train": Configured(config="train", module="train", pipeline="train"),
    "evaluate": Configured(
        config="evaluate", module="evaluate", pipeline="evaluate", translate=with_flags
    ),
    "train-simulator": Configured(
        config="train-simulator", module="train_simulator", pipeline="train_simulator"
    ),
    "train-judge": Configured(config="train-judge", module="train_judge", pipeline="train_judge"),
    "prepare": Configured(config="prepare", module="prepare", pipeline="prepare"),
    "simulate": Configured(config="simulate", module="simulate", pipeline="simulate"),
    "render": Configured(config="render", module="render", pipeline="render"),
    "score": Configured(
        config="score", module="score_files", pipeline="score_files", translate=with_files
    ),
    "trial": Configured(config="trial", module="trial", pipeline="trial"),
    "check": Configured(config="check", module="check", pipeline="check"),
    "calibrate": Configured(config="calibrate", module="calibrate", pipeline="calibrate"),
}


def run_configured(verb: str, arguments: Sequence[str]) -> None:
    """Compose the configuration of a verb and hand it to its pipeline."""
    import hydra

    from eqs.pipelines.keys import keys_explained
    from eqs.pipelines.resolvers import register_resolvers

    command, typed = CONFIGURED[verb], list(sys.argv)
    register_resolvers()

    @hydra.main(version_base="1.3", config_path=str(CONFIGS), config_name=command.config)
    def compose_and_run(cfg: DictConfig) -> object:
        sys.argv = typed  # processes that Lightning starts type the same command again
        try:
            with needed("all", f"for eqs {verb}"):
                module = import_module(f"eqs.pipelines.{command.module}")
        except ValueError as error:
            sys.exit(str(error))
        return getattr(module, command.pipeline)(cfg)

    given = [with_quoted_path(each) for each in command.translate(arguments)]
    sys.argv = [typed[0], *given]
    try:
        with keys_explained(given):
            compose_and_run()
    finally:
        sys.argv = typed
