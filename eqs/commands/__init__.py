"""The command line: `eqs VERB`, and the scripts that are one verb each."""

from eqs.commands.dispatch import main, run

__all__ = ["main", "run"]
