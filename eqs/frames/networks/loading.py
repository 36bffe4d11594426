"""Tells what a file holds, and makes a network of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from eqs.frames.networks.planes import Between
from eqs.frames.networks.rife import is_rife, rife_of
from eqs.frames.networks.scripted import is_script, script_of
from eqs.frames.networks.super_slomo import is_super_slomo, super_slomo_of
from eqs.frames.networks.weights import contents, wanted

SHOWN = 4  # names of a dictionary that are shown to who brought a wrong one


def network_of(path: Path) -> Between:
    """The network in a file, whichever of the understood layouts it has.

    A TorchScript file, such as FILM's, brings its own program. A Super SloMo checkpoint, as v2e,
    Vid2E and Prophesee published them, and the weights of RIFE 4.25 are put into networks of ours.
    All run on the processor in float32.

    Args:
        path: the file.

    Returns:
        A function of two frames (H, W) or (H, W, 3), levels 0 to 255, and shares of the way from
        the first to the second, that gives the frames there.

    Raises:
        ValueError: the file holds something else.
    """
    if is_script(path):
        return script_of(path)
    content = contents(path)
    if isinstance(content, Mapping):
        if is_super_slomo(content):
            return super_slomo_of(content, path)
        if is_rife(content):
            return rife_of(content, path)
    raise ValueError(wanted(path, described(content)))


def described(content: object) -> str:
    """What a file holds, in a few words.

    Example:
        >>> described({"epoch": 3, "weights": None})
        'a dictionary with epoch, weights'
        >>> described([])
        'a list'
    """
    if isinstance(content, Mapping):
        names = [str(name) for name in content]
        more = ["..."] if len(names) > SHOWN else []
        return f"a dictionary with {', '.join([*names[:SHOWN], *more]) or 'nothing'}"
    return f"a {type(content).__name__}"
