"""Any event file: what it is, told by its first bytes, and the events that it holds."""

from __future__ import annotations

from pathlib import Path

import h5py

from eqs.events.aedat import read_aedat2, read_aedat3, read_aedat4
from eqs.events.atis import HEADER, read_event_stream, read_forty_bits
from eqs.events.decoded import Decoded
from eqs.events.hints import NOTHING_SAID, Hints
from eqs.events.loaded import LoadedEvents
from eqs.events.matlab import read_matlab
from eqs.events.raw import read_prophesee
from eqs.events.reader import EventReader
from eqs.events.ros import read_bag
from eqs.events.tables import read_foreign_hdf5, read_numpy, read_text

READ = (
    "DSEC, v2e, event_utils, MVSEC, M3ED and Metavision HDF5, RAW (EVT2, EVT2.1, EVT3), DAT, "
    "AEDAT 2, 3.1 and 4, Event Stream, ROS bags, 40-bit .bin, npy, npz, MATLAB, text and CSV"
)


def open_events(
    path: Path | str,
    height: int | None = None,
    width: int | None = None,
    rows: int | None = None,
) -> EventReader | LoadedEvents:
    """A file in the layout of DSEC, read piece by piece, or any other, read whole.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is of no known kind, or damaged, or nobody says its sensor's size.
    """
    if is_dsec(Path(path)):
        return EventReader(path, height, width, rows)
    hints = Hints(height=height, width=width)
    return LoadedEvents(decode(path, hints).events(height, width), rows)


def is_dsec(path: Path) -> bool:
    """Whether a file is HDF5 in the layout of DSEC; one that cannot be opened may be.

    Raises:
        FileNotFoundError: there is no such file.
    """
    if _first_bytes(path)[:8] != b"\x89HDF\r\n\x1a\n":
        return path.suffix.lower() in (".h5", ".hdf5")  # whose reader says what is wrong
    try:
        with h5py.File(path) as file:
            return "ms_to_idx" in file
    except OSError:
        return True  # whose reader says what is wrong


def decode(path: Path | str, hints: Hints = NOTHING_SAID) -> Decoded:
    """The events of a file that is not in the layout of DSEC.

    Args:
        path: the file.
        hints: what the file leaves open.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is of no known kind, or damaged, or fits several readings.
    """
    path = Path(path)
    first = _first_bytes(path)
    if first[:8] == b"\x89HDF\r\n\x1a\n":
        return read_foreign_hdf5(path, hints)
    if first[:1] == b"%":
        return read_prophesee(path)
    for start, read in (
        (b"#!AER-DAT2", read_aedat2), (b"#!AER-DAT3", read_aedat3), (b"#!AER-DAT4", read_aedat4),
        (HEADER, read_event_stream), (b"#ROSBAG", read_bag), (b"SQLite format 3", read_bag),
        (b"\x89MCAP", read_bag),
    ):  # fmt: skip
        if first.startswith(start):
            return read(path)
    if first[:6] == b"\x93NUMPY" or (first[:4] == b"PK\x03\x04" and path.suffix == ".npz"):
        return read_numpy(path, hints)
    if first.startswith(b"MATLAB "):
        return read_matlab(path, hints)
    if path.suffix == ".bin":
        return read_forty_bits(path)
    if path.suffix.lower() in (".txt", ".csv", ".zip", ".tsv", ".dat"):
        return read_text(path, hints)
    raise ValueError(f"Expected {READ} in {path}, got none of them; convert it")


def _first_bytes(path: Path) -> bytes:
    if not path.is_file():
        raise FileNotFoundError(
            f"Expected an event file at {path}, found none; check data.root, or make the file first"
        )
    with path.open("rb") as file:
        return file.read(32)
