"""Pictures of what sensors, simulators and detectors see: events, boxes, maps over the image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike, NDArray

from eqs.drawing.style import BRIGHTER, DARKER, STYLE, figure
from eqs.events import Events
from eqs.names import REFERENCE

# Away from the red and blue of the events.
BOX_COLOURS = ("#007a5a", "#c46a00", "#8e3a87", "#5c4a1e", "#00838f", "#4a4a4a")
PICTURE: dict[Any, Any] = {**STYLE, "axes.grid": False, "axes.titlesize": 10}
PANEL_INCHES = 2.9


@dataclass(frozen=True, kw_only=True, eq=False)
class Boxes:
    """Boxes of one image: true ones, or detections with scores.

    Args:
        corners: left, top, right, bottom in pixels, shape (n, 4).
        labels: class of each, shape (n,).
        scores: confidence of each, shape (n,); None for true boxes.
    """

    corners: NDArray[np.floating]
    labels: NDArray[np.integer]
    scores: NDArray[np.floating] | None = None

    def __post_init__(self) -> None:
        """Check that the fields describe the same boxes."""
        n = len(self.labels)
        shapes = (np.shape(self.corners), None if self.scores is None else len(self.scores))
        if shapes not in ((((n, 4)), None), ((n, 4), n)):
            raise ValueError(
                f"Expected corners of shape ({n}, 4) and as many scores for {n} labels, got "
                f"corners {shapes[0]} and {shapes[1]} scores"
            )


def event_image(events: Events, *, pale: float = 0.0) -> NDArray[np.float64]:
    """Colour of the last event of every pixel on white, shape (height, width, 3), in [0, 1].

    Convention: blue is brighter, red is darker, as in the paper.

    Args:
        events: the events to show.
        pale: share of white mixed in, to draw something on top.
    """
    image = np.ones((events.height, events.width, 3))
    both = np.array([to_rgb(DARKER), to_rgb(BRIGHTER)])
    # Assigned in order of time, so that the last event of a pixel stays.
    image[events.y, events.x] = (1 - pale) * both[events.p] + pale
    return image


def events_panels(
    frame: NDArray[np.uint8] | None,
    streams: Mapping[str, Events],
    *,
    start_us: int,
    stop_us: int,
    same: Literal["time", "count"] = "time",
) -> Figure:
    """The same instant as a frame and as the events of every stream.

    Args:
        frame: the video frame of that instant, grey or RGB, if there is one.
        streams: events by name; the recorded ones are called `real`.
        start_us: start of the window shown.
        stop_us: end of the window, and the instant itself.
        same: `time` shows every event of the window; `count` shows equally many events before
            `stop_us` in every panel, as many as the sparsest stream has in the window.

    Raises:
        ValueError: there is no stream, or `same` is neither.
    """
    if not streams or same not in ("time", "count"):
        raise ValueError(
            "Expected at least one stream and same to be time or count, got "
            f"{len(streams)} streams and {same!r}"
        )
    shown = {name: events.window(start_us, stop_us) for name, events in streams.items()}
    heading = f"Every event of the same {(stop_us - start_us) / 1000:g} ms"
    if same == "count":
        fewest = min(map(len, shown.values()))
        shown = {name: part[len(part) - fewest :] for name, part in shown.items()}
        heading = f"The last {fewest:,} events of every stream before the same instant"
    order = sorted(shown, key=lambda name: name != REFERENCE)
    with mpl.rc_context(PICTURE):
        drawing, panels = _panels(len(shown) + (frame is not None), shown[order[0]])
        if frame is not None:
            _frame(panels[0], frame, "video frame")
        for axes, name in zip(panels[frame is not None :], order, strict=True):
            axes.imshow(event_image(shown[name]), interpolation="nearest")
            title = "real sensor" if name == REFERENCE else name
            axes.set_title(f"{title}: {len(shown[name]):,} events")
        drawing.suptitle(heading, fontsize=10)
        marks = [
            Line2D([], [], marker="s", linestyle="", color=colour) for colour in (BRIGHTER, DARKER)
        ]
        drawing.legend(
            marks, ["became brighter", "became darker"], loc="outside lower center", ncols=2
        )
    return drawing


def detection_panels(
    events: Events,
    truth: Boxes,
    detections: Mapping[str, Boxes],
    *,
    class_names: Sequence[str],
    min_score: float = 0.3,
    frame: NDArray[np.uint8] | None = None,
) -> Figure:
    """What every detector finds in the same real events, beside the true boxes.

    Args:
        events: real events of the window before the labels.
        truth: the true boxes.
        detections: by system the detector was trained on.
        class_names: name of every label.
        min_score: detections below it are not drawn.
        frame: a video frame for the first panel instead of the events.
    """
    with mpl.rc_context(PICTURE):
        drawing, panels = _panels(1 + len(detections), events)
        image = event_image(events, pale=0.45)
        if frame is None:
            panels[0].imshow(image, interpolation="nearest")
            panels[0].set_title("true boxes")
        else:
            _frame(panels[0], frame, "video frame, true boxes")
        _draw_boxes(panels[0], truth, class_names, dashed=True, named=True)
        for axes, (name, found) in zip(panels[1:], detections.items(), strict=True):
            axes.imshow(image, interpolation="nearest")
            kept = above(found, min_score)
            _draw_boxes(axes, truth, class_names, dashed=True)
            _draw_boxes(axes, kept, class_names)
            axes.set_title(f"trained on {_named(name)}: {len(kept.labels)} found")
        present = np.unique(
            np.concatenate([truth.labels, *(found.labels for found in detections.values())])
        ).astype(int)
        keys = [Line2D([], [], color=box_colour(label)) for label in present]
        names = [class_names[label] for label in present]
        keys.append(Line2D([], [], color="#222222", linestyle="--"))
        drawing.legend(
            keys,
            [*names, "true box"],
            loc="outside lower center",
            ncols=len(keys),
            title=f"detections with a confidence of at least {min_score:g}",
        )
    return drawing


def score_maps(
    frame: NDArray[np.uint8] | None,
    maps: Mapping[str, ArrayLike],
    *,
    patch_px: int | None,
    height: int,
    width: int,
) -> Figure:
    """EQS of every patch of the image, one panel per simulator on a common colour scale.

    Args:
        frame: a video frame of the scene for the first panel, if there is one.
        maps: by simulator, shape (patch rows, patch columns), patches counted from the upper
            left; NaN where nothing was scored. Patches may reach beyond the image.
        patch_px: side of a patch in pixels; None where the patches divide the image evenly.
        height: rows of the image.
        width: columns of the image.

    Raises:
        ValueError: there is no map.
    """
    if not maps:
        raise ValueError("Expected at least one map, got none; score a simulator first")
    arrays = {name: np.asarray(values, dtype=float) for name, values in maps.items()}
    finite = np.concatenate([values[np.isfinite(values)] for values in arrays.values()])
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    with mpl.rc_context(PICTURE):
        drawing, panels = _panels(len(arrays) + (frame is not None), Events.empty(height, width))
        if frame is not None:
            _frame(panels[0], frame, "video frame")
        for axes, (name, values) in zip(panels[frame is not None :], arrays.items(), strict=True):
            reach = (height, width)
            if patch_px is not None:
                reach = (values.shape[0] * patch_px, values.shape[1] * patch_px)
            drawn = axes.imshow(
                np.ma.masked_invalid(values),
                cmap="viridis",
                vmin=low,
                vmax=high if high > low else low + 1,
                extent=(-0.5, reach[1] - 0.5, reach[0] - 0.5, -0.5),
                interpolation="nearest",
            )
            axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
            mean = f"mean {np.nanmean(values):.3f}" if np.isfinite(values).any() else "not scored"
            axes.set_title(f"{name}: {mean}")
        scale = drawing.colorbar(drawn, ax=list(panels), shrink=0.8, aspect=25)
        scale.set_label("EQS of the patch\n(higher is better)")
    return drawing


def _panels(count: int, like: Events) -> tuple[Figure, list[Axes]]:
    """A grid of bare axes, at most three beside each other, shaped like the sensor."""
    columns = count if count <= 3 else (2 if count == 4 else 3)
    rows = -(-count // columns)
    tall = PANEL_INCHES * like.height / like.width + 0.35
    drawing = figure(PANEL_INCHES * columns, tall * rows + 0.7)
    drawing.set_layout_engine("compressed")
    grid = list(drawing.subplots(rows, columns, squeeze=False).flat)
    for axes in grid:
        axes.set(xticks=[], yticks=[])
        for side in axes.spines.values():
            side.set_visible(True)
            side.set_color("#bbbbbb")
    for axes in grid[count:]:
        axes.remove()
    return drawing, grid[:count]


def _frame(axes: Axes, frame: NDArray[np.uint8], title: str) -> None:
    axes.imshow(frame, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
    axes.set_title(title)


def _named(name: str) -> str:
    return "real events" if name == REFERENCE else name


def above(boxes: Boxes, min_score: float) -> Boxes:
    """The boxes whose confidence reaches `min_score`; true boxes are all kept."""
    if boxes.scores is None:
        return boxes
    kept = np.asarray(boxes.scores) >= min_score
    return Boxes(corners=boxes.corners[kept], labels=boxes.labels[kept], scores=boxes.scores[kept])


def box_colour(label: int) -> str:
    """The colour that stands for a class in every picture."""
    return BOX_COLOURS[label % len(BOX_COLOURS)]


def _draw_boxes(
    axes: Axes,
    boxes: Boxes,
    class_names: Sequence[str],
    *,
    dashed: bool = False,
    named: bool = False,
) -> None:
    for at, (left, top, right, bottom) in enumerate(boxes.corners):
        label = int(boxes.labels[at])
        colour = "#222222" if dashed and not named else box_colour(label)
        axes.add_patch(
            Rectangle(
                (left - 0.5, top - 0.5),
                right - left,
                bottom - top,
                fill=False,
                edgecolor=colour,
                linestyle="--" if dashed else "-",
                linewidth=1.0 if dashed else 1.6,
            )
        )
        text = class_names[label] if named else ""
        if boxes.scores is not None:
            text = f"{boxes.scores[at]:.2f}"
        if text:
            axes.text(
                left - 0.5,
                top - 1,
                text,
                color=colour,
                fontsize=7,
                va="bottom",
                clip_on=True,
                bbox={"facecolor": "white", "alpha": 0.7, "pad": 0.5, "linewidth": 0},
            )
