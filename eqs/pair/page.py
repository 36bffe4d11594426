"""One page that shows two streams side by side, where and when they differ, and why."""

from __future__ import annotations

import base64
import html
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from eqs.events import Events
from eqs.files import write_text
from eqs.pair.diagnosis import Diagnosis

MOST_WINDOWS: Final = 200
MOST_PIXELS: Final = 20_000_000  # of all pictures of a stream together
PALETTE: Final = (255, 255, 255, 215, 48, 31, 44, 95, 209)  # nothing, darker, brighter
MARK: Final = "/*DATA*/"


@dataclass(frozen=True, kw_only=True)
class PageWindows:
    """The windows that a page shows.

    Args:
        numbers: which windows of the score.
        simulated: pictures of the simulated stream, as data URIs.
        real: of the real stream.
        maps: similarity by patch, shape (rows, columns) each; NaN where nothing happens.
    """

    numbers: Sequence[int]
    simulated: Sequence[str]
    real: Sequence[str]
    maps: Sequence[NDArray[np.float64]]


def shown_windows(count: int, height: int, width: int) -> list[int]:
    """Numbers of the windows that a page of bounded size shows, evenly chosen.

    Example:
        >>> shown_windows(5, 480, 640), len(shown_windows(5000, 480, 640))
        ([0, 1, 2, 3, 4], 65)
    """
    most = max(1, min(count, MOST_WINDOWS, MOST_PIXELS // (height * width)))
    chosen: list[int] = np.unique(np.linspace(0, count - 1, most).round().astype(int)).tolist()
    return chosen


def event_uri(events: Events) -> str:
    """The last event of every pixel as a PNG in three colours, as a data URI."""
    image = np.zeros((events.height, events.width), np.uint8)
    image[events.y, events.x] = 1 + events.p
    picture = Image.fromarray(image, "P")
    picture.putpalette(PALETTE)
    return _uri(picture, optimize=True)


def map_uri(similarity: NDArray[np.float64]) -> str:
    """A map as a PNG: white where the streams agree, dark where not, grey where nothing happens."""
    level = np.clip(np.nan_to_num(similarity, nan=1.0), 0.0, 1.0)[..., None]
    near, far = np.array([255.0, 250.0, 240.0]), np.array([103.0, 0.0, 60.0])
    colours = far + (near - far) * level
    colours[np.isnan(similarity)] = 190.0
    return _uri(Image.fromarray(colours.round().astype(np.uint8), "RGB"))


def _uri(picture: Image.Image, **options: Any) -> str:  # noqa: ANN401
    buffer = io.BytesIO()
    picture.save(buffer, "PNG", **options)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def write_page(
    path: Path,
    *,
    title: str,
    lines: Sequence[str],
    curve: NDArray[np.float64],
    warmup: int,
    window_us: int,
    levels: Mapping[str, float],
    windows: PageWindows,
    diagnosis: Diagnosis,
    nearest: Sequence[tuple[str, float]],
    size: tuple[int, int],
) -> None:
    """Write a page that needs no network, no other file and no server.

    Args:
        path: the file.
        title: what was compared.
        lines: what the console says, in sentences.
        curve: score of every window.
        warmup: windows at the start that do not count.
        window_us: length of a window.
        levels: by name what the curve is compared with, as chance and ceiling.
        windows: what the slider shows.
        diagnosis: what else differs.
        nearest: damages of the real stream with their scores.
        size: rows and columns of the sensor.
    """
    template = (files("eqs.pair") / "page.html").read_text(encoding="utf-8")
    data = {
        "curve": [None if np.isnan(value) else round(float(value), 4) for value in curve],
        "warmup": warmup,
        "seconds": 1e-6 * window_us,
        "levels": {name: value for name, value in levels.items() if np.isfinite(value)},
        "numbers": list(windows.numbers),
        "simulated": list(windows.simulated),
        "real": list(windows.real),
        "maps": [map_uri(each) for each in windows.maps],
        "size": list(size),
    }
    rows = [
        f"<tr><th scope=row>{html.escape(f.name)}</th><td>{_shown(f.simulated)}</td>"
        f"<td>{_shown(f.real)}</td><td>{html.escape(f.unit)}</td>"
        f"<td>{html.escape(f.sentence)}</td></tr>"
        for f in diagnosis.findings
    ]
    damages = [
        f"<tr><th scope=row>{html.escape(words)}</th><td>{value:.3f}</td></tr>"
        for words, value in nearest
    ]
    parts = {
        "<!--TITLE-->": html.escape(title),
        "<!--LINES-->": "\n".join(f"<p>{html.escape(line)}</p>" for line in lines),
        "<!--DIAGNOSIS-->": "\n".join(rows),
        "<!--NEAREST-->": "\n".join(damages),
        # What closes a script in a text would end it here as well.
        MARK: json.dumps(data).replace("</", "<\\/"),
    }
    for mark, text in parts.items():
        template = template.replace(mark, text)
    write_text(template, path)


def _shown(value: float) -> str:
    return "none" if np.isnan(value) else f"{value:.3g}"
