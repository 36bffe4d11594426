"""Builders of small random streams and DSEC folders, shared by all tests."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from eqs.events import Events

TRACK_FIELDS = [
    ("t", "<u8"),
    ("x", "<f4"),
    ("y", "<f4"),
    ("w", "<f4"),
    ("h", "<f4"),
    ("class_id", "u1"),
    ("class_confidence", "<f4"),
    ("track_id", "<u4"),
]


def random_events(count, height=24, width=32, start_us=0, stop_us=1_000_000, seed=0) -> Events:
    """A sorted stream of uniformly drawn events."""
    generator = np.random.default_rng(seed)
    return Events.from_arrays(
        t=np.sort(generator.integers(start_us, stop_us, count)),
        x=generator.integers(0, width, count),
        y=generator.integers(0, height, count),
        p=generator.integers(0, 2, count),
        height=height,
        width=width,
    )


def tracks_of(rows) -> np.ndarray:
    """A label array in DSEC's type from rows (t, x, y, w, h, class_id)."""
    tracks = np.zeros(len(rows), TRACK_FIELDS)
    for index, name in enumerate(("t", "x", "y", "w", "h", "class_id")):
        tracks[name] = [row[index] for row in rows]
    tracks["class_confidence"] = 1.0
    tracks["track_id"] = np.arange(len(rows))
    return tracks


def write_recording(
    folder,
    frames=6,
    height=24,
    width=32,
    start_us=1_000_000,
    period_us=50_000,
    events_per_window=400,
    colour=False,
    tracks="some",
    seed=0,
) -> Path:
    """One sequence in the layout of DSEC: frames, timestamps, exposures, events, tracks."""
    folder = Path(folder)
    images = folder / "images" / "left" / "distorted"
    images.mkdir(parents=True)
    generator = np.random.default_rng(seed)
    times = start_us + period_us * np.arange(frames)
    for index in range(frames):
        shape = (height, width, 3) if colour else (height, width)
        picture = generator.integers(0, 256, shape).astype(np.uint8)
        Image.fromarray(picture).save(images / f"{index:06d}.png")
    (folder / "images" / "timestamps.txt").write_text("".join(f"{time}\n" for time in times))
    exposures = "".join(f"{time - 500}, {time + 500}\n" for time in times)
    (folder / "images" / "left" / "exposure_timestamps.txt").write_text(
        "# exposure_start_timestamp_us, exposure_end_timestamp_us\n" + exposures
    )
    (folder / "events" / "left").mkdir(parents=True)
    events = random_events(
        events_per_window * frames, height, width, times[0], times[-1] + 1, seed=seed
    )
    events.save(folder / "events" / "left" / "events.h5")
    if tracks is not None:
        rows = (
            [(time, 4 + index, 5, 12, 10, 2) for index, time in enumerate(times)]
            if tracks == "some"
            else tracks
        )
        (folder / "object_detections" / "left").mkdir(parents=True)
        np.save(folder / "object_detections" / "left" / "tracks.npy", tracks_of(rows))
    return folder


@pytest.fixture(scope="session")
def make_events():
    """`random_events` as a fixture."""
    return random_events


@pytest.fixture(scope="session")
def make_tracks():
    """`tracks_of` as a fixture."""
    return tracks_of


@pytest.fixture(scope="session")
def make_recording():
    """`write_recording` as a fixture."""
    return write_recording


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory):
    """Tests remember hashes in a place of their own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield
