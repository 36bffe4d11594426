"""Prophesee's RAW files (EVT2, EVT2.1, EVT3) and DAT files.

Source: the published descriptions of the encodings; every word is little-endian.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from eqs.events.decoded import Clock, Decoded, blocks
from eqs.events.words import Arrays, evt2, evt3, evt21, untold

LONGEST_HEADER = 1 << 20
# Sensors by the name of the camera's plugin, where a header does not state the size.
PLUGINS = {"gen41": (720, 1280), "imx636": (720, 1280), "gen3": (480, 640), "genx320": (320, 320)}
ENCODINGS: dict[str, tuple[str, Callable[[NDArray[Any], NDArray[np.int64]], Arrays]]] = {
    "2": ("<u4", evt2), "2.0": ("<u4", evt2), "2.1": ("<u8", evt21),
    "3": ("<u2", evt3), "3.0": ("<u2", evt3),
}  # fmt: skip


def read_prophesee(path: Path, size: int) -> Iterator[Decoded]:
    """Events of a file that begins with lines of `%`, about `size` bytes of it at a time.

    Raises:
        ValueError: the header names no encoding that is read here.
    """
    with path.open("rb") as file:
        header, start = split_header(file.read(LONGEST_HEADER))
        file.seek(start)
        text = "\n".join(header)
        version = re.search(r"(?i)\bevt\s*(\d+(?:\.\d+)?)", text)
        height, width = size_of(text)
        if version is None:
            if path.suffix.lower() != ".dat" and "ersion" not in text:
                raise ValueError(
                    f"Expected a header with the encoding (% evt 3.0) in {path}, got none; write "
                    "it again with its header"
                )
            yield from _dat(file, size, text, height, width)
            return
        if version[1] not in ENCODINGS:
            raise ValueError(
                f"Expected EVT2, EVT2.1 or EVT3 in {path}, got EVT{version[1]}; convert it with "
                "Metavision's metavision_file_to_dat"
            )
        kind, decode = ENCODINGS[version[1]]
        state = untold()
        for content in blocks(file, size, np.dtype(kind).itemsize):
            t, x, y, p, dropped = decode(np.frombuffer(content, kind), state)
            yield Decoded(
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


def _dat(
    file: BinaryIO, size: int, text: str, height: int | None, width: int | None
) -> Iterator[Decoded]:
    """Pairs of time and event, 32 bits each, after two bytes of type and size."""
    file.read(2)
    clock = Clock(1 << 32)
    second = re.search(r"(?i)% *version *2", text)
    for content in blocks(file, size, 8):
        pairs = np.frombuffer(content, "<u4").reshape(-1, 2)
        data = pairs[:, 1]
        if second:
            x, y, p = data & 0x3FFF, data >> 14 & 0x3FFF, data >> 28 & 1
        else:
            x, y, p = data & 0x1FF, data >> 9 & 0xFF, data >> 17 & 1
        t = clock.counted(pairs[:, 0])
        yield Decoded(kind="a DAT file", t=t, x=x, y=y, p=p, height=height, width=width)
