"""RAW and DAT files of Prophesee cameras: EVT2, EVT2.1, EVT3, and 2D events of old recordings.

Source: the published descriptions of the encodings; every word is little-endian.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.events.decoded import Decoded, last_before, unwrapped

LONGEST_HEADER = 1 << 20
# Sensors by the name of the camera's plugin, where a header does not state the size.
PLUGINS = {"gen41": (720, 1280), "imx636": (720, 1280), "gen3": (480, 640), "genx320": (320, 320)}


def read_prophesee(path: Path) -> Decoded:
    """Events of a file that begins with lines of `%`.

    Raises:
        ValueError: the header names no encoding that is read here, or data are cut off.
    """
    content = path.read_bytes()
    header, start = split_header(content)
    text = "\n".join(header)
    version = re.search(r"(?i)\bevt\s*(\d+(?:\.\d+)?)", text)
    height, width = size_of(text)
    if version is None:
        if path.suffix.lower() != ".dat" and "ersion" not in text:
            raise ValueError(
                f"Expected a header with the encoding (% evt 3.0) in {path}, got none; write it "
                "again with its header"
            )
        return _dat(content, start, text, height, width)
    if version[1] not in ENCODINGS:
        raise ValueError(
            f"Expected EVT2, EVT2.1 or EVT3 in {path}, got EVT{version[1]}; convert it with "
            "Metavision's metavision_file_to_dat"
        )
    kind, decode = ENCODINGS[version[1]]
    whole = (len(content) - start) // kind.itemsize
    t, x, y, p, dropped = decode(np.frombuffer(content, kind, whole, start))
    return Decoded(
        kind=f"a RAW file (EVT{version[1]})", t=t, x=x, y=y, p=p,
        height=height, width=width, dropped=dropped,
    )  # fmt: skip


def split_header(content: bytes) -> tuple[list[str], int]:
    r"""Lines of the header, and where the data begin.

    Example:
        >>> split_header(b"% evt 3.0\n% end\n%\x00")
        (['% evt 3.0', '% end'], 16)
    """
    lines: list[str] = []
    at = 0
    while content[at : at + 1] == b"%" and at < LONGEST_HEADER:
        stop = content.find(b"\n", at)
        if stop < 0:
            break
        lines.append(content[at:stop].decode("latin-1").strip())
        at = stop + 1
        if lines[-1] == "% end":
            break
    return lines, at


def size_of(header: str) -> tuple[int | None, int | None]:
    """Height and width that a header states."""
    geometry = re.search(r"(?i)geometry[ :]+(\d+)x(\d+)", header)
    if geometry:
        return int(geometry[2]), int(geometry[1])
    found = [re.search(rf"(?i)\b{name}[ =:]+(\d+)", header) for name in ("height", "width")]
    if found[0] and found[1]:
        return int(found[0][1]), int(found[1][1])
    for plugin, size in PLUGINS.items():
        if re.search(rf"plugin_name \w*{plugin}", header):
            return size
    return None, None


Arrays = tuple[NDArray[np.int64], NDArray[Any], NDArray[Any], NDArray[Any], int]


def evt2(words: NDArray[np.uint32]) -> Arrays:
    """Words of 32 bits: time high (28 bits of 64 us), or one event with 6 bits of time."""
    kinds = words >> 28
    seen = last_before(kinds == 8)
    event = kinds <= 1
    timed = event & (seen >= 0)
    high = _high(words & 0x0FFFFFFF, kinds == 8, 28)
    chosen = words[timed].astype(np.int64)
    t = (high[seen[timed]] << 6) | (chosen >> 22 & 0x3F)
    dropped = int(event.sum() - timed.sum())
    return t, chosen >> 11 & 0x7FF, chosen & 0x7FF, kinds[timed].astype(np.int64), dropped


def evt21(words: NDArray[np.uint64]) -> Arrays:
    """Words of 64 bits: time high, or up to 32 events of one row and one time."""
    kinds = words >> np.uint64(60)
    seen = last_before(kinds == 8)
    group = kinds <= 1
    timed = group & (seen >= 0)
    high = _high(words >> np.uint64(32) & np.uint64(0x0FFFFFFF), kinds == 8, 28)
    chosen = words[timed].astype(np.int64)
    t = (high[seen[timed]] << 6) | (chosen >> 54 & 0x3F)
    lanes = (chosen[:, None] >> np.arange(32) & 1).astype(bool)
    row, lane = np.nonzero(lanes)
    x = (chosen >> 43 & 0x7FF)[row] + lane
    dropped = int(group.sum() - timed.sum())
    return t[row], x, (chosen >> 32 & 0x7FF)[row], kinds[timed].astype(np.int64)[row], dropped


def evt3(words: NDArray[np.uint16]) -> Arrays:
    """Words of 16 bits that each change one thing: row, time, base column, or bring events."""
    kinds, value = words >> 12, (words & 0xFFF).astype(np.int64)
    row, low, high, base = (last_before(kinds == kind) for kind in (0, 6, 8, 3))
    turns = _high(value, kinds == 8, 12)
    # A new time high brings a low of zero until the next low is told.
    times = (turns[high] << 12) + np.where(low > _last_change(value, kinds == 8), value[low], 0)
    single = kinds == 2
    vector = (kinds == 4) | (kinds == 5)
    placed = (high >= 0) & (row >= 0)
    good = (single & placed) | (vector & placed & (base >= 0))
    # Every vector moves the base on by its lanes: count those since the base was told.
    lanes = np.where(kinds == 4, 12, np.where(kinds == 5, 8, 0))
    before = np.cumsum(lanes) - lanes
    offset = np.where(base >= 0, before - before[base], 0)
    one = np.flatnonzero(single & good)
    many = np.flatnonzero(vector & good)
    bits = np.where(kinds[many] == 5, value[many] & 0xFF, value[many])
    which, lane = np.nonzero((bits[:, None] >> np.arange(12) & 1).astype(bool))
    many = many[which]
    index = np.concatenate([one, many])
    x = np.concatenate([value[one] & 0x7FF, (value[base[many]] & 0x7FF) + offset[many] + lane])
    p = np.concatenate([value[one] >> 11 & 1, value[base[many]] >> 11 & 1])
    order = np.argsort(index, kind="stable")
    index = index[order]
    dropped = int(((single | vector) & ~good).sum())
    return times[index], x[order], value[row[index]] & 0x7FF, p[order], dropped


def _high(values: NDArray[Any], mark: NDArray[np.bool_], bits: int) -> NDArray[np.int64]:
    """The high part of the time at every word that tells it, counted on past its turns."""
    found = np.zeros(len(values), np.int64)
    found[mark] = unwrapped(values[mark].astype(np.int64), 1 << bits)
    return found


def _last_change(value: NDArray[np.int64], mark: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Index of the word that last told another time high than the one before it."""
    told = np.flatnonzero(mark)
    changed = np.zeros(len(value), np.bool_)
    changed[told[np.r_[True, np.diff(value[told]) != 0][: len(told)]]] = True
    return last_before(changed)


def _dat(content: bytes, start: int, text: str, height: int | None, width: int | None) -> Decoded:
    """Pairs of time and event, 32 bits each, after two bytes of type and size."""
    body = content[start + 2 :]
    pairs = np.frombuffer(body[: len(body) // 8 * 8], "<u4").reshape(-1, 2).astype(np.int64)
    data = pairs[:, 1]
    t = unwrapped(pairs[:, 0], 1 << 32)
    if re.search(r"(?i)% *version *2", text):
        x, y, p = data & 0x3FFF, data >> 14 & 0x3FFF, data >> 28 & 1
    else:
        x, y, p = data & 0x1FF, data >> 9 & 0xFF, data >> 17 & 1
    return Decoded(kind="a DAT file", t=t, x=x, y=y, p=p, height=height, width=width)


ENCODINGS: dict[str, tuple[np.dtype[Any], Callable[[NDArray[Any]], Arrays]]] = {
    "2": (np.dtype("<u4"), evt2), "2.0": (np.dtype("<u4"), evt2), "2.1": (np.dtype("<u8"), evt21),
    "3": (np.dtype("<u2"), evt3), "3.0": (np.dtype("<u2"), evt3),
}  # fmt: skip
