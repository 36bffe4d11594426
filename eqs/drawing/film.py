"""Event streams as moving pictures: a GIF, an MP4, or a strip of stills."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from PIL.PngImagePlugin import PngInfo

from eqs.drawing.pictures import Boxes, above, box_colour, event_image
from eqs.drawing.style import BRIGHTER, DARKER
from eqs.events import EventReader, Events
from eqs.events.loaded import LoadedEvents
from eqs.extras import needed
from eqs.files import MADE_HERE, complete_file, refuse_foreign

Picture = NDArray[np.uint8]
STILLS = 8  # in a strip


def event_picture(events: Events) -> Picture:
    """The last event of every pixel on white, uint8 (H, W, 3)."""
    return (255 * event_image(events)).round().astype(np.uint8)


def histogram_picture(histogram: NDArray[np.integer]) -> Picture:
    """Pixels with more brighter or more darker events in their colour on white, (H, W, 3).

    Args:
        histogram: counts (2 * bins, H, W), those of darker events first.
    """
    darker, brighter = histogram.reshape(2, -1, *histogram.shape[-2:]).astype(np.int64).sum(1)
    picture = np.ones((*darker.shape, 3))
    picture[(darker > 0) & (darker >= brighter)] = to_rgb(DARKER)
    picture[brighter > darker] = to_rgb(BRIGHTER)
    return (255 * picture).round().astype(np.uint8)


def event_pictures(
    reader: EventReader | LoadedEvents,
    *,
    start_us: int,
    stop_us: int,
    window_us: int = 33_000,
    pictures: int = 30,
) -> Iterator[Picture]:
    """Evenly spaced pictures of the events just before each instant, uint8 (H, W, 3).

    Args:
        reader: the stream.
        start_us: when the first window starts.
        stop_us: when the last window ends.
        window_us: how far back a picture looks.
        pictures: how many.

    Raises:
        ValueError: the stretch of time is shorter than a window, or no picture is asked for.
    """
    for end_us in picture_times(start_us, stop_us, window_us, pictures):
        yield event_picture(reader.window(int(end_us) - window_us, int(end_us)))


def picture_times(start_us: int, stop_us: int, window_us: int, pictures: int) -> NDArray[np.int64]:
    """The instants of evenly spaced pictures, each of which looks back a window.

    Raises:
        ValueError: the stretch of time is shorter than a window, or no picture is asked for.
    """
    if stop_us - start_us < window_us or window_us < 1 or pictures < 1:
        raise ValueError(
            f"Expected at least one picture and a stretch of at least a window of {window_us} us, "
            f"got {pictures} pictures of {stop_us - start_us} us"
        )
    return np.linspace(start_us + window_us, stop_us, pictures).astype(np.int64)


def framed(picture: Picture, frame: NDArray[np.uint8]) -> Picture:
    """A video frame, grey or RGB, with the events of its instant below.

    Raises:
        ValueError: the two differ in size.
    """
    if frame.shape[:2] != picture.shape[:2]:
        raise ValueError(
            f"Expected frames as large as the sensor, {picture.shape[:2]}, got {frame.shape[:2]}; "
            "name the folder that these events are of"
        )
    colour = frame if frame.ndim == 3 else np.repeat(frame[..., None], 3, axis=2)
    return np.concatenate([colour, picture])


def with_boxes(picture: Picture, boxes: Boxes, *, min_score: float = 0.3) -> Picture:
    """A copy with the outlines of the boxes, a colour for each class.

    Args:
        picture: RGB, on whose pixels the boxes are measured.
        boxes: true boxes, or detections, of which those below `min_score` are left out.
        min_score: smallest confidence shown.
    """
    drawn = Image.fromarray(picture)
    pen = ImageDraw.Draw(drawn)
    shown = above(boxes, min_score)
    for corners, label in zip(shown.corners, shown.labels, strict=True):
        outline = tuple(round(255 * part) for part in to_rgb(box_colour(int(label))))
        left, top, right, bottom = (round(float(edge)) for edge in corners)
        pen.rectangle((left, top, max(right - 1, left), max(bottom - 1, top)), outline=outline)
    return np.asarray(drawn)


def write_film(
    path: Path | str, pictures: Sequence[Picture], *, frames_per_second: float = 30.0, zoom: int = 1
) -> None:
    """Write pictures as `.gif`, `.mp4` or, a few of them side by side, `.png`.

    The file appears under its name once it is complete, and says that it was made here; another
    one in its place is left alone.

    Args:
        path: where to; the ending chooses the format.
        pictures: RGB, all of one size.
        frames_per_second: how fast they play.
        zoom: side of the square that a pixel becomes.

    Raises:
        ValueError: an unknown ending, no picture, or a file that was not made here is there.
    """
    path = Path(path)
    refuse_foreign(path)
    writers = {".gif": _write_gif, ".mp4": _write_mp4, ".png": _write_strip}
    if path.suffix not in writers or not len(pictures) or zoom < 1:
        raise ValueError(
            f"Expected a name that ends in {', '.join(writers)}, pictures, and a zoom of 1 or "
            f"more, got {path}, {len(pictures)} pictures and {zoom}"
        )
    large = [picture.repeat(zoom, axis=0).repeat(zoom, axis=1) for picture in pictures]
    with complete_file(path) as partial:
        writers[path.suffix](partial, large, frames_per_second)


def _write_gif(path: Path, pictures: Sequence[Picture], frames_per_second: float) -> None:
    first, *rest = [Image.fromarray(picture) for picture in pictures]
    duration_ms = round(1000 / frames_per_second)
    played = {"append_images": rest, "duration": duration_ms, "loop": 0, "comment": MADE_HERE}
    first.save(path, format="GIF", save_all=True, **played)


def _write_mp4(path: Path, pictures: Sequence[Picture], frames_per_second: float) -> None:
    with needed("video", "to write an MP4 (a GIF needs none)"):
        import av
    height, width = pictures[0].shape[:2]
    with av.open(str(path), "w", format="mp4") as container:
        container.metadata["comment"] = MADE_HERE
        stream = container.add_stream("h264", rate=max(1, round(frames_per_second)))
        stream.height, stream.width = height + height % 2, width + width % 2
        stream.pix_fmt = "yuv420p"
        for picture in pictures:  # H.264 wants even sides
            even = np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
            container.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")))
        container.mux(stream.encode())


def _write_strip(path: Path, pictures: Sequence[Picture], _: float) -> None:
    chosen = np.linspace(0, len(pictures) - 1, min(STILLS, len(pictures))).round().astype(int)
    gap = np.full((pictures[0].shape[0], 4, 3), 128, np.uint8)
    row: list[Picture] = []
    for index in chosen:
        row += [pictures[index], gap]
    said = PngInfo()
    said.add_text("Software", MADE_HERE)
    Image.fromarray(np.concatenate(row[:-1], axis=1)).save(path, format="PNG", pnginfo=said)
