"""Where the parts of a sequence lie below a data set's root, in each of DSEC's three layouts.

DSEC comes as one tree, as a folder for every archive that was unpacked
(`train_events/SEQUENCE/events` beside `train_images/SEQUENCE/images`), or as downloads of single
sequences, whose archives hold bare files and carry the sequence's name (`SEQUENCE_events_left`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from eqs.frames.order import natural_key

EVENTS = Path("events/left/events.h5")
FRAMES = Path("images/left/distorted")
RECTIFIED = Path("images/left/rectified")
FRAME_TIMES = Path("images/timestamps.txt")
EXPOSURES = Path("images/left/exposure_timestamps.txt")
TRACKS = Path("object_detections/left/tracks.npy")
CALIBRATION = Path("calibration/cam_to_cam.yaml")
# Each part's place in a sequence's folder, and its name as a download.
PARTS = {
    "events": (EVENTS, Path("events_left/events.h5")),
    "frames": (FRAMES, Path("images_distorted_left")),
    "rectified": (RECTIFIED, Path("images_rectified_left")),
    "frame_times": (FRAME_TIMES, Path("image_timestamps.txt")),
    "exposures": (EXPOSURES, Path("image_exposure_timestamps_left.txt")),
    "tracks": (TRACKS, Path("object_detections_left/tracks.npy")),
    "calibration": (CALIBRATION, Path("calibration/cam_to_cam.yaml")),
}
SIGNS = {place.parts[0] for places in PARTS.values() for place in places}
# What a recording of another camera's program looks like: one event file, and frames beside it.
EVENT_SUFFIXES = (
    ".raw", ".dat", ".aedat", ".aedat4", ".es", ".bag", ".db3", ".mcap", ".h5", ".hdf5", ".npz",
    ".npy", ".bin", ".csv", ".mat",
)  # fmt: skip
LOOSE_FRAMES = ("frames", "images")
LOOSE_TIMES = ("timestamps.txt", "frames/timestamps.txt", "images/timestamps.txt")
DEEPEST = 3  # folders between the root and a part's sequence
UNFINISHED = ".partial"


@dataclass(frozen=True, kw_only=True)
class Places:
    """The parts of one sequence; a part that is missing has the place where it was expected.

    Args:
        name: the sequence's name.
        folder: the folder that is named where something is wrong with the sequence.
        events: file of the events.
        frames: folder of the frames in the view of the event camera.
        rectified: folder of the frames in a view of their own.
        frame_times: file of the frames' times.
        exposures: file of the frames' exposures.
        tracks: file of the labels.
        calibration: file of the cameras' calibration.
    """

    name: str
    folder: Path
    events: Path
    frames: Path
    rectified: Path
    frame_times: Path
    exposures: Path
    tracks: Path
    calibration: Path

    @classmethod
    def inside(cls, folder: Path) -> Places:
        """The parts of a sequence in a folder of its own, all of them in one tree."""
        parts = {part: folder / tree for part, (tree, _) in PARTS.items()}
        return cls(name=folder.name, folder=folder, **parts)


def find_sequences(root: Path) -> dict[str, Places]:
    """The sequences below a root in the order of their numbers, each with all of its parts.

    Raises:
        FileNotFoundError: there is no such folder.
        ValueError: there is no sequence, or two places hold the same part of one.
    """
    if not root.is_dir():
        raise FileNotFoundError(
            f"Expected a data set at {root}, found no such folder; set data.root"
        )
    found: dict[str, dict[str, Path]] = {}
    homes: dict[str, Path] = {}
    for name, part, path, home in _parts_below(root):
        homes.setdefault(name, home)
        parts = found.setdefault(name, {})
        if part in parts:
            raise ValueError(
                f"Expected each sequence once below {root}, got {name} in {parts[part]} and "
                f"{path}; remove one"
            )
        if part:
            parts[part] = path
    if not found:
        raise ValueError(_none_found(root))
    return {name: _places(homes[name], name, found[name]) for name in sorted(found, key=_order)}


def find_recordings(root: Path) -> dict[str, Places]:
    """The sequences below a root, and folders that hold one event file of any kind.

    Frames of the latter are images in `frames` or `images`, their times lie in `timestamps.txt`.

    Raises:
        FileNotFoundError: there is no such folder.
        ValueError: there is neither, or a folder holds several event files.
    """
    loose = [path for path in root.iterdir() if path.is_dir()] if root.is_dir() else []
    found = {places.name: places for folder in loose if (places := _loose(folder)) is not None}
    try:
        found = {**find_sequences(root), **found}
    except ValueError:
        if not found:
            raise
    return {name: found[name] for name in sorted(found, key=_order)}


def _loose(folder: Path) -> Places | None:
    files = [path for path in folder.iterdir() if path.suffix.lower() in EVENT_SUFFIXES]
    if not files or folder.name.startswith(".") or folder.name.endswith(UNFINISHED):
        return None
    if len(files) > 1:
        raise ValueError(
            f"Expected one event file in {folder}, got {', '.join(sorted(f.name for f in files))}; "
            "keep one"
        )
    places = Places.inside(folder)
    if places.events.exists() or (folder / "events_left").exists():
        return None
    frames = (folder / name for name in LOOSE_FRAMES)
    times = (folder / name for name in LOOSE_TIMES)
    return replace(
        places,
        events=files[0],
        frames=next((path for path in frames if path.is_dir()), places.frames),
        frame_times=next((path for path in times if path.is_file()), places.frame_times),
    )


def _order(name: str) -> tuple[object, str]:
    return natural_key(name), name


def _places(home: Path, name: str, parts: dict[str, Path]) -> Places:
    expected = {part: home / tree for part, (tree, _) in PARTS.items()}
    return Places(name=name, folder=home, **{**expected, **parts})


def _parts_below(folder: Path, depth: int = 0) -> Iterator[tuple[str, str, Path, Path]]:
    """Sequence, part, its place, and the sequence's folder, of all parts below a folder.

    A sequence's folder that holds none of the parts is told with no part.
    """
    entries = sorted(folder.iterdir())
    prefixes = {name for entry in entries if (name := _download_of(entry)) is not None}
    for name in prefixes:
        for part, path in _existing(folder / f"{name}_", name):
            yield name, part, path, folder / name
    for entry in entries:
        hidden = entry.name.startswith(".") or entry.name.endswith(UNFINISHED)
        if hidden or _download_of(entry) is not None or not entry.is_dir():
            continue
        if _is_sequence(entry):
            yield entry.name, "", entry, entry
            for part, path in _existing(entry, entry.name):
                yield entry.name, part, path, entry
        elif depth + 1 < DEEPEST:
            yield from _parts_below(entry, depth + 1)


def _download_of(entry: Path) -> str | None:
    """The sequence of which a file or folder is a download; None where it is none."""
    for _, download in PARTS.values():
        first, *inner = download.parts
        name = entry.name.removesuffix(f"_{first}")
        if name and name != entry.name and entry.joinpath(*inner).exists():
            return name
    return None


def _is_sequence(folder: Path) -> bool:
    names = {path.name for path in folder.iterdir()}
    own = any(f"{folder.name}_{sign}" in names for sign in SIGNS)
    return own or not names.isdisjoint(SIGNS)


def _existing(place: Path, name: str) -> Iterator[tuple[str, Path]]:
    """The parts that lie in a sequence's folder, or beside it where the place ends in `_`."""
    for part, (tree, download) in PARTS.items():
        if place.name == f"{name}_":
            candidates = {place.parent / f"{name}_{download}"}
        else:
            candidates = {place / tree, place / download, place / f"{name}_{download}"}
        yield from ((part, path) for path in sorted(candidates) if path.exists())


def _none_found(root: Path) -> str:
    if _is_sequence(root):
        return (
            f"Expected a folder of sequences at {root}, got a sequence; set data.root to "
            f"{root.parent}"
        )
    archives = sum(1 for _ in root.glob("**/*.zip"))
    if archives:
        return (
            f"Expected sequences in the layout of DSEC below {root}, found {archives} archives; "
            "unpack each into a folder of its own, named as the archive"
        )
    return (
        f"Expected sequences in the layout of DSEC below {root}, found none; set data.root to the "
        "folder that holds them, or that of train/ and test/"
    )
