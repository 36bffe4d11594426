"""What every command does around its work: one sentence for a mistake, not a stack of frames."""

from __future__ import annotations

import functools
import logging
import os
import warnings
from collections.abc import Callable
from typing import TypeVar

from hydra.errors import InstantiationException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

log = logging.getLogger(__name__)
Result = TypeVar("Result")


def explained(command: Callable[[DictConfig], Result]) -> Callable[[DictConfig], Result]:
    """Turn an expected failure of a command into one logged sentence and exit status 1.

    `HYDRA_FULL_ERROR=1` keeps the full traceback, as it does for Hydra's own errors.
    """

    @functools.wraps(command)
    def run(cfg: DictConfig) -> Result:
        quiet_libraries()
        try:
            return command(cfg)
        except (ValueError, OSError, InstantiationException, OmegaConfBaseException) as error:
            if os.environ.get("HYDRA_FULL_ERROR"):
                raise
            log.error("%s", sentence(error))
            raise SystemExit(1) from error

    return run


def sentence(error: BaseException) -> str:
    """The message of the mistake itself, below what wraps it."""
    if isinstance(error, InstantiationException) and error.__cause__ is not None:
        where = str(error).rsplit("full_key: ", maxsplit=1)
        key = f" (config key {where[1].strip()})" if len(where) > 1 else ""
        return sentence(error.__cause__) + key
    return str(error) or type(error).__name__


def quiet_libraries() -> None:
    """Silence what Lightning says about itself; what it says about the training stays."""
    for message in (
        ".*isinstance.treespec",  # torch and Lightning disagree about a name
        ".*does not have many workers",  # windows are binned faster than a laptop trains
        ".*smaller than the logging interval",
    ):
        warnings.filterwarnings("ignore", message=message)
    for name in ("lightning.pytorch.utilities.rank_zero", "lightning.fabric.utilities.seed"):
        logging.getLogger(name).setLevel(logging.WARNING)
