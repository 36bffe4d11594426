"""One page that shows two streams side by side, where and when they differ, and why."""

from __future__ import annotations

import html
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.files import write_text
from eqs.pair.diagnosis import Diagnosis, Finding
from eqs.pair.nearest import Nearest
from eqs.pair.pictures import AGREE, DIFFER, PageWindows

MARK: Final = re.compile(r"<!--([A-Z]+)-->|/\*(DATA)\*/")
LONGEST_CURVE: Final = 20_000


@dataclass(frozen=True, kw_only=True, eq=False)
class PageContent:
    """What a page says and shows.

    Args:
        title: what was compared.
        lines: what the console says, in sentences.
        reading: name of the score that the curve and the maps show.
        curve: score of every window; NaN where no patch counts.
        warmup: windows at the start that do not count.
        start_us: start of the first window.
        window_us: length of a window.
        levels: by name what the curve is compared with, as chance and ceiling.
        windows: what the slider shows.
        diagnosis: what else differs.
        nearest: damages of the real stream with their scores; none where they were not asked for.
        size: rows and columns of the sensor.
    """

    title: str
    lines: Sequence[str]
    reading: str
    curve: NDArray[np.float64]
    warmup: int
    start_us: int
    window_us: int
    levels: Mapping[str, float]
    windows: PageWindows
    diagnosis: Diagnosis
    nearest: Sequence[Nearest]
    size: tuple[int, int]


def write_page(path: Path, content: PageContent) -> Path:
    """Write a page that needs no network, no other file and no server."""
    return write_text(render_page(content), path)


def render_page(content: PageContent) -> str:
    """The page as text; every text in it is escaped."""
    template = (files("eqs.pair") / "page.html").read_text(encoding="utf-8")
    scale = ", ".join(f"rgb{colour}" for colour in (DIFFER, AGREE))
    parts = {
        "TITLE": html.escape(content.title),
        "READING": html.escape(content.reading),
        "LINES": "\n".join(f"<p>{html.escape(line)}</p>" for line in content.lines),
        "DIAGNOSIS": "\n".join(map(_finding_row, content.diagnosis.findings)),
        "SECONDS": f"{content.diagnosis.seconds:.3g}",
        "NEAREST": "\n".join(map(_damage_row, content.nearest)) or _no_damage(),
        "SCALE": scale,
        # What closes a script in a text would end it here as well.
        "DATA": json.dumps(_data(content), allow_nan=False).replace("</", "<\\/"),
    }
    # In one pass, so that a mark within a text stays a text.
    return MARK.sub(lambda found: parts[found[1] or found[2]], template)


def _data(content: PageContent) -> dict[str, object]:
    """What the page's script reads."""
    shown = content.windows.within()
    step = -(-len(content.curve) // LONGEST_CURVE)
    curve = [None if math.isnan(value) else round(value, 4) for value in content.curve.tolist()]
    return {
        "reading": content.reading,
        "curve": curve[::step],
        "step": step,
        "values": [curve[number] for number in shown.numbers],
        "warmup": content.warmup,
        "windowSeconds": 1e-6 * content.window_us,
        "startSeconds": 1e-6 * content.start_us,
        "levels": {
            name: round(value, 4) for name, value in content.levels.items() if math.isfinite(value)
        },
        "numbers": list(shown.numbers),
        "simulated": list(shown.simulated),
        "real": list(shown.real),
        "maps": list(shown.maps),
        "size": list(content.size),
    }


def _finding_row(found: Finding) -> str:
    name, unit, said = (html.escape(text) for text in (found.name, found.unit, found.sentence))
    unit = f" <small>{unit}</small>" if unit else ""
    return (
        f'<tr><th scope="row">{name}{unit}</th>'
        f'<td data-label="simulated">{shown(found.simulated)}</td>'
        f'<td data-label="real">{shown(found.real)}</td>'
        f'<td data-label="which means">{said}</td></tr>'
    )


def _damage_row(found: Nearest) -> str:
    return (
        f'<tr><th scope="row">{html.escape(found.words)}</th>'
        f'<td data-label="scores">{found.score:.3f}</td>'
        f'<td data-label="unlike by">{found.apart:.3f}</td></tr>'
    )


def _no_damage() -> str:
    return (
        '<tr><td colspan="3">Not tried: nearest was false, or the real stream is silent.</td></tr>'
    )


def shown(value: float) -> str:
    """A figure for a person.

    Example:
        >>> shown(0.123456), shown(12.0), shown(float("nan"))
        ('0.123', '12', 'none')
    """
    return "none" if math.isnan(value) else f"{value:.3g}"
