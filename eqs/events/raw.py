"""RAW and DAT files of Prophesee cameras: EVT2, EVT2.1, EVT3, and 2D events of old recordings.

Source: the published descriptions of the encodings; every word is little-endian.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.events.decoded import Decoded, last_before, unwrapped

LONGEST_HEADER = 1 << 20
PIECE_BYTES = 1 << 19
# Sensors by the name of the camera's plugin, where a header does not state the size.
PLUGINS = {"gen41": (720, 1280), "imx636": (720, 1280), "gen3": (480, 640), "genx320": (320, 320)}


def read_prophesee(path: Path) -> Decoded:
    """Events of a file that begins with lines of `%`.

    Raises:
        ValueError: the header names no encoding that is read here.
    """
    pieces = raw_pieces(path)
    if pieces is None:
        content = path.read_bytes()
        header, start = split_header(content)
        text = "\n".join(header)
        return _dat(content, start, text, *size_of(text))
    parts = list(pieces)
    t, x, y, p = (np.concatenate([getattr(part, name) for part in parts]) for name in "txyp")
    dropped = sum(part.dropped for part in parts)
    return replace(parts[0], t=t, x=x, y=y, p=p, dropped=dropped)


def raw_pieces(path: Path, at_once: int = PIECE_BYTES) -> Iterator[Decoded] | None:
    """Events of a RAW file in its order, so many bytes at a time; None where it is no RAW file.

    There is at least one piece, which may be empty; together they are what the whole file is,
    however it is cut.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the header names no encoding that is read here.
    """
    with path.open("rb") as file:
        header, start = split_header(file.read(LONGEST_HEADER))
    if not header:
        return None
    text = "\n".join(header)
    version = re.search(r"(?i)\bevt\s*(\d+(?:\.\d+)?)", text)
    height, width = size_of(text)
    if version is None:
        if path.suffix.lower() != ".dat" and "ersion" not in text:
            raise ValueError(
                f"Expected a header with the encoding (% evt 3.0) in {path}, got none; write it "
                "again with its header"
            )
        return None
    if version[1] not in ENCODINGS:
        raise ValueError(
            f"Expected EVT2, EVT2.1 or EVT3 in {path}, got EVT{version[1]}; convert it with "
            "Metavision's metavision_file_to_dat"
        )
    kind = f"a RAW file (EVT{version[1]})"
    encoding = ENCODINGS[version[1]]
    parts = _cut(path, start, encoding, max(1, at_once // encoding.word.itemsize))
    return (
        Decoded(kind=kind, t=t, x=x, y=y, p=p, height=height, width=width, dropped=dropped)
        for t, x, y, p, dropped in parts
    )


def _cut(path: Path, start: int, encoding: Encoding, words_at_once: int) -> Iterator[Arrays]:
    """Decode so many words at a time, each time behind those that say where the last ones ended."""
    before, turned_us = np.empty(0, encoding.word), 0
    known = 0  # words behind which no event can stand yet, counted with their own piece
    with path.open("rb") as file:
        file.seek(start)
        while True:
            content = file.read(words_at_once * encoding.word.itemsize)
            whole = len(content) // encoding.word.itemsize
            words = np.concatenate([before, np.frombuffer(content, encoding.word, whole)])
            t, x, y, p, dropped = encoding.decode(words)
            yield t + turned_us, x, y, p, dropped - known
            if whole < words_at_once:
                return
            before, further_us = encoding.context(words)
            turned_us += further_us
            known = encoding.decode(before)[4]


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


def _turned(values: NDArray[Any], bits: int) -> int:
    """How far the last of the times high has counted on past its bits."""
    values = values.astype(np.int64)
    return int(unwrapped(values, 1 << bits)[-1] - values[-1]) if len(values) else 0


def _context2(words: NDArray[Any]) -> Context:
    high = words[words >> 28 == 8]
    return high[-1:], _turned(high & 0x0FFFFFFF, 28) << 6


def _context21(words: NDArray[Any]) -> Context:
    high = words[words >> np.uint64(60) == 8]
    return high[-1:], _turned(high >> np.uint64(32) & np.uint64(0x0FFFFFFF), 28) << 6


def _context3(words: NDArray[Any]) -> Context:
    """The last row, base, time high and, where it is younger than that, time low.

    Empty vectors behind the base move it on as far as it was.
    """
    kinds, value = words >> 12, (words & 0xFFF).astype(np.int64)
    row, low, high, base = (np.flatnonzero(kinds == kind) for kind in (0, 6, 8, 3))
    kept = [words[row[-1:]], words[base[-1:]]]
    if len(base):
        moved = words[base[-1] + 1 :]
        kept.append(moved[(moved >> 12 == 4) | (moved >> 12 == 5)] & 0xF000)
    kept.append(words[high[-1:]])
    changed = _last_change(value, kinds == 8)[-1:]
    if len(low) and len(high) and low[-1] > changed[0]:
        kept.append(words[low[-1:]])
    return np.concatenate(kept), _turned(value[high], 12) << 12


Context = tuple[NDArray[Any], int]


class Encoding(NamedTuple):
    """An encoding of RAW files: its words, what they mean, and what of them the next ones need."""

    word: np.dtype[Any]
    decode: Callable[[NDArray[Any]], Arrays]
    context: Callable[[NDArray[Any]], Context]


EVT2 = Encoding(np.dtype("<u4"), evt2, _context2)
EVT21 = Encoding(np.dtype("<u8"), evt21, _context21)
EVT3 = Encoding(np.dtype("<u2"), evt3, _context3)
ENCODINGS = {"2": EVT2, "2.0": EVT2, "2.1": EVT21, "3": EVT3, "3.0": EVT3}
