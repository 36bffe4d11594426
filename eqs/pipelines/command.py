"""What every command does around its work: one sentence for a mistake, not a stack of frames."""

from __future__ import annotations

import functools
import logging
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Final, TypeVar
from zipfile import BadZipFile

from hydra.errors import InstantiationException
from omegaconf import DictConfig
from omegaconf.errors import MissingMandatoryValue, OmegaConfBaseException
from PIL.Image import DecompressionBombError
from yaml import YAMLError

from eqs.extras import lacking
from eqs.files import is_full
from eqs.pipelines.keys import in_this_command
from eqs.pipelines.sensors import check_sensor

log = logging.getLogger(__name__)
Result = TypeVar("Result")
# Failures that files, settings and machines cause; any other is a mistake of ours.
EXPECTED: Final = (
    ValueError, OSError, EOFError, MemoryError, ImportError, BadZipFile, YAMLError,
    DecompressionBombError, InstantiationException, OmegaConfBaseException,
)  # fmt: skip


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, with what is kept of the work."""


def explained(command: Callable[[DictConfig], Result]) -> Callable[[DictConfig], Result]:
    """Turn an expected failure of a command into one logged sentence and exit status 1.

    Ctrl-C ends in a sentence too, with the exit status that shells give it, 130.

    `HYDRA_FULL_ERROR=1` keeps the full traceback, as it does for Hydra's own errors.
    """

    @functools.wraps(command)
    def run(cfg: DictConfig) -> Result:
        quiet_libraries()
        try:
            check_seed(cfg)
            check_sensor(cfg)
            return command(cfg)
        except KeyboardInterrupt as stop:
            kept = str(stop) or "whatever is complete is kept"
            log.warning("interrupted: %s; type the same command again to go on", kept)
            raise SystemExit(130) from None
        except EXPECTED as error:
            if os.environ.get("HYDRA_FULL_ERROR"):
                raise
            log.error("%s", sentence(error, cfg))
            raise SystemExit(1) from error

    return run


def check_seed(cfg: DictConfig) -> None:
    """Refuse what is no seed to every generator that gets it.

    Raises:
        ValueError: the seed is not a whole number of 32 bits.
    """
    if "seed" in cfg and (not isinstance(cfg.seed, int) or not 0 <= cfg.seed < 2**32):
        raise ValueError(
            f"Expected seed to be a whole number from 0 to {2**32 - 1}, got {cfg.seed!r}; set seed"
        )


def sentence(error: BaseException, cfg: DictConfig, where: str = "") -> str:
    """The message of the mistake itself, below what wraps it, with a key to change."""
    if isinstance(error, InstantiationException) and error.__cause__ is not None:
        place = str(error).rpartition("full_key: ")[2].strip() if "full_key: " in str(error) else ""
        message = sentence(error.__cause__, cfg, place)
        return f"{message} (config key {place})" if place else message
    if isinstance(error, ModuleNotFoundError):  # an optional package of Lightning's
        return lacking(error, "all", f"for {where}" if where else "for this")
    if (said := of_machine(error)) is not None:
        return said
    if isinstance(error, TypeError | AttributeError):  # of a constructor: a text for a number
        return f"Expected values of the configured kinds, got another: {error}; set them anew"
    if isinstance(error, MissingMandatoryValue):
        return f"Expected a value for {error.full_key}, got none; set {error.full_key}=..."
    if isinstance(error, OmegaConfBaseException):
        return f"{str(error).splitlines()[0]} (config key {error.full_key})"
    if is_full(error):
        place = getattr(error, "filename", None) or "the folders below paths"
        return (
            f"Expected room to write {place}, got a full disk; make room, or set "
            f"{path_keys(place, cfg)}"
        )
    if isinstance(error, OSError) and error.errno is not None:
        reason = str(error.strerror).splitlines()[0]  # HDF5 tells the rest of its story below
        return (
            f"Expected to read and write {error.filename or 'files'}, got: {reason}; "
            f"set {path_keys(error.filename, cfg)}"
        )
    return in_this_command(str(error), cfg, where) or type(error).__name__


def of_machine(error: BaseException) -> str | None:
    """The sentence about memory, damaged files and packages; None for any other failure."""
    said = str(error).splitlines()[0] if str(error) else ""
    if isinstance(error, ImportError):
        return f"Expected the packages of this command to load, got: {said}; install them anew"
    if isinstance(error, MemoryError):
        return (
            f"Expected memory enough, got none left ({said or 'it does not say for what'}); "
            "set fewer workers, jobs or windows at once"
        )
    if isinstance(error, EOFError | BadZipFile | YAMLError | DecompressionBombError):
        return (
            f"Expected files that are whole, got: {said or 'it ends too early'}; write or fetch "
            "them anew"
        )
    return None


def path_keys(filename: object, cfg: DictConfig) -> str:
    """The configured places above or below a file, as keys."""
    file = Path(str(filename)).absolute()
    places = {key: Path(str(place)).absolute() for key, place in cfg.paths.items()}
    keys = [
        f"paths.{key}"
        for key, place in places.items()
        if file.is_relative_to(place) or place.is_relative_to(file)
    ]
    return " or ".join(keys or ["data.root or the keys below paths"])


def quiet_libraries() -> None:
    """Silence what Lightning says about itself; what it says about the training stays."""
    for message in (
        ".*isinstance.treespec",  # torch and Lightning disagree about a name
        ".*does not have many workers",  # windows are binned faster than a laptop trains
        ".*smaller than the logging interval",
        ".*exists and is not empty",  # as it should when a training is resumed
        ".*It is recommended to use .*sync_dist=True",  # a mAP is that of all processes already
        ".*The dirpath has changed",  # as it should when a training goes on for longer
    ):
        warnings.filterwarnings("ignore", message=message)
    for name in ("lightning.pytorch.utilities.rank_zero", "lightning.fabric.utilities.seed"):
        logging.getLogger(name).setLevel(logging.WARNING)
