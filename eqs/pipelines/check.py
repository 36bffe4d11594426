"""See whether a data set can be used as it lies there, recording by recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from hydra.utils import instantiate
from omegaconf import DictConfig
from rich.console import Console
from rich.progress import track
from rich.table import Table

from eqs.data import Dataset, LabelProtocol, Recording, seen_between_frames
from eqs.events import EventReader
from eqs.pipelines.command import explained
from eqs.pipelines.sensors import other_sensor, require_events
from eqs.processors import available_cores, side_by_side

READ_AT_ONCE_US = 1_000_000
SILENT_US = 1_000_000  # no event for so long is worth a word
FEW = 3


@dataclass
class Finding:
    """What one recording holds, in words for a table, and what is wrong with it."""

    name: str
    split: str
    frames: str = ""
    frame_span: str = ""
    events: str = ""
    event_span: str = ""
    labels: str = ""
    gaps: str = ""
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Inspection:
    """How recordings are looked at.

    Args:
        data: the data set.
        protocol: which labels count.
        window_us: length of a window of the detector.
        thorough: whether every frame and event is read.
    """

    data: Dataset
    protocol: LabelProtocol
    window_us: int
    thorough: bool

    def __call__(self, place: tuple[str, Any]) -> Finding:
        """Look at the recording of a sequence; whatever is wrong becomes a fault."""
        split, places = place
        found = Finding(places.name, split)
        try:
            recording = self.data.load(places)
        except (ValueError, OSError) as error:
            found.faults.append(str(error))
            return found
        self._frames(recording, found)
        self._events(recording, found)
        self._labels(recording, found)
        return found

    def _frames(self, recording: Recording, found: Finding) -> None:
        times = recording.frame_times_us
        found.frames = f"{len(recording.frame_paths)}"
        if len(times) > 1:
            steps = np.diff(times)
            period = float(np.median(steps))
            found.frame_span = f"{(times[-1] - times[0]) / 1e6:.2f}"
            wide = int((steps > 1.5 * period).sum())
            if wide:
                found.gaps = f"{wide} up to {steps.max() / 1e6:.2f} s"
            _, said = seen_between_frames(times, self.window_us)
            found.notes += [said] if said else []
        if not recording.has_frames:
            found.notes.append(f"there are no frames to simulate from: {recording.without_frames}")
        for index in self._some(len(recording.frame_paths)):
            try:
                recording.read_frame(index)
            except (ValueError, OSError) as error:
                found.faults.append(str(error))

    def _events(self, recording: Recording, found: Finding) -> None:
        size = recording.height, recording.width
        try:
            with EventReader(recording.events_path, *size) as events:
                found.events = short_count(len(events))
                if events.extent_us is None:
                    found.faults.append(f"Expected events in {events.path}, got none")
                    return
                start, stop = events.extent_us
                found.event_span = f"{(stop - start) / 1e6:.2f}"
                silence = events.longest_silence_us()
                if silence >= SILENT_US:
                    found.notes.append("there is a second or more without an event")
                starts = range(start, stop, READ_AT_ONCE_US)
                for index in self._some(len(starts)):
                    events.window(starts[index], starts[index] + READ_AT_ONCE_US)
        except (ValueError, OSError) as error:
            found.faults.append(str(error))
            return
        self._spans(recording, (start, stop), found)

    def _spans(self, recording: Recording, span: tuple[int, int], found: Finding) -> None:
        if not len(recording.frame_times_us):
            return
        first, last = (int(time) for time in recording.frame_times_us[[0, -1]])
        shared = max(0, min(last, span[1]) - max(first, span[0]))
        share = shared / max(1, last - first)
        if not shared:
            found.faults.append(
                f"Expected events and frames of one clock in {recording.folder}, got frames from "
                f"{first} to {last} us and events from {span[0]} to {span[1]} us; correct t_offset "
                "or the frames' times"
            )
        elif share < 0.98:
            found.notes.append(f"events cover {100 * share:.0f} % of the time of the frames")

    def _labels(self, recording: Recording, found: Finding) -> None:
        if not recording.has_labels:
            found.labels = "none"
            return
        matched = self.protocol.match(recording.tracks, recording.frame_times_us)
        found.labels = f"{matched.matched}/{matched.label_times}"
        if matched.share < self.protocol.least_matched_labels:
            found.faults.append(
                f"Expected labels within {self.protocol.label_tolerance_us} us of a frame in "
                f"{recording.folder}, got {matched.matched} of {matched.label_times} label times "
                "that are; put both on one clock, or set protocol.label_tolerance_us"
            )
        elif matched.farthest_us:
            found.notes.append(f"labels lie up to {matched.farthest_us} us beside their frames")

    def _some(self, count: int) -> Sequence[int]:
        if self.thorough or count <= FEW:
            return range(count)
        return [0, count // 2, count - 1]


@explained
def check(cfg: DictConfig) -> None:
    """Print what every recording holds, what is wrong, and what to do about it.

    Raises:
        FileNotFoundError: there is no such folder.
        ValueError: a recording cannot be used.
    """
    data: Dataset = instantiate(cfg.data)
    protocol: LabelProtocol = instantiate(cfg.protocol)
    protocol.require_known(data.classes)
    look = Inspection(data=data, protocol=protocol, window_us=cfg.window_us, thorough=cfg.thorough)
    places = [(split, each) for split, held in data.sequences().items() for each in held]
    other = other_sensor(cfg)
    if other is not None:
        require_events(data, other)
    workers = min(available_cores(), len(places)) or 1
    looked = side_by_side(partial(look), places, workers) if len(places) > 1 else map(look, places)
    findings = list(track(looked, description="checking", total=len(places)))
    order = {(split, each.name): index for index, (split, each) in enumerate(places)}
    findings.sort(key=lambda finding: order[finding.split, finding.name])
    empty = [split for split, held in data.sequences().items() if not held]
    chosen = f"{cfg.data.name}{'' if other is None else f' sensor={other.name}'}"
    show(findings, empty, chosen, Console())
    faulty = [finding for finding in findings if finding.faults]
    if faulty or not findings:
        raise ValueError(advice(findings, faulty))


def show(findings: Sequence[Finding], empty: Sequence[str], name: str, console: Console) -> None:
    """Print a table for each split, what is worth knowing, every fault and, last, what to do."""
    columns = ("frames", "frame_span", "events", "event_span", "labels", "gaps")
    for split in dict.fromkeys(finding.split for finding in findings):
        table = Table(
            title=f"{split}; spans in seconds, labels as matched/all", title_justify="left"
        )
        table.add_column("recording", no_wrap=True)
        for column in ("frames", "span", "events", "span", "labels", "gaps", "faults"):
            table.add_column(column, justify="right")
        for finding in findings:
            if finding.split == split:
                cells = [getattr(finding, column) for column in columns]
                table.add_row(finding.name, *cells, str(len(finding.faults) or ""))
        console.print(table)
    for note, names in grouped(findings).items():
        some = ", ".join(names[:FEW]) + (
            f" and {len(names) - FEW} more" if len(names) > FEW else ""
        )
        console.print(f"[bold]note[/bold]: {note} ({some})", highlight=False)
    for split in empty:
        console.print(f"[bold]note[/bold]: no recording of the {split} split is there")
    for finding in findings:
        for fault in finding.faults:
            console.print(f"[bold red]fault[/bold red] in {finding.name}: {fault}", highlight=False)
    if findings and not any(finding.faults for finding in findings):
        labelled = any(finding.labels not in ("", "none") for finding in findings)
        following = "train.py sim=real" if labelled else "evaluate.py --eqs"
        console.print(
            f"all {len(findings)} recordings can be used; type python {following} data={name}"
        )


def grouped(findings: Sequence[Finding]) -> dict[str, list[str]]:
    """Who shares each note."""
    found: dict[str, list[str]] = {}
    for finding in findings:
        for note in finding.notes:
            found.setdefault(note, []).append(finding.name)
    return found


def advice(findings: Sequence[Finding], faulty: Sequence[Finding]) -> str:
    """What to do, in the last line."""
    names = (finding.name for finding in faulty)
    return (
        f"Expected recordings that can be used, got {len(faulty)} of {len(findings)} with faults "
        f"({', '.join(names)}); mend what is named above or remove their folders, and check again"
    )


def short_count(number: int) -> str:
    """A number with three digits and a unit.

    Example:
        >>> [short_count(number) for number in (0, 999, 36_498, 1_234_567, 2_500_000_000)]
        ['0', '999', '36.5 k', '1.23 M', '2.5 G']
    """
    for unit, size in (("G", 10**9), ("M", 10**6), ("k", 10**3)):
        if number >= size:
            return f"{number / size:.3g} {unit}"
    return str(number)
