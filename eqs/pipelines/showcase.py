"""One instant of the test set, as every sensor, simulator and detector sees it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from eqs.data import EventSource, LabelProtocol, Recording
from eqs.drawing import Boxes
from eqs.events import EventReader, Events
from eqs.pipelines.detections import detections_over
from eqs.pipelines.runs import Run

# Long enough for motion to show, short enough for a sharp picture.
WINDOW_US = 50_000
RATE_SPAN_US = 1_500_000
WELCOME_BOXES = 4  # in a picture that shows what detectors find


@dataclass(frozen=True, kw_only=True)
class Showcase:
    """A recording and the frame at which it is shown.

    Args:
        recording: the recording.
        index: number of the frame.
    """

    recording: Recording
    index: int

    @property
    def stop_us(self) -> int:
        """The instant itself."""
        return int(self.recording.frame_times_us[self.index])

    @property
    def frame(self) -> NDArray[np.uint8]:
        """The video frame of the instant, 8 bits deep."""
        frame: NDArray[np.uint8] = np.rint(self.recording.read_frame(self.index)).astype(np.uint8)
        return frame

    def events(self, source: EventSource, before_us: int = WINDOW_US) -> Events:
        """Events of one source up to the instant."""
        recording = self.recording
        with EventReader(source.path(recording), recording.height, recording.width) as reader:
            return reader.window(self.stop_us - before_us, self.stop_us)

    def truth(self, protocol: LabelProtocol) -> Boxes:
        """The labelled boxes of the instant that count."""
        matched = protocol.match(self.recording.tracks, self.recording.frame_times_us)
        rows = matched.at(self.index)
        corners, labels = protocol.select(rows, self.recording.height, self.recording.width)
        return Boxes(corners=corners, labels=labels)


def choose(recordings: Sequence[Recording], protocol: LabelProtocol) -> Showcase:
    """An instant after the first second with many classes, and boxes apart, about four, and large.

    Without labels it is the middle of the first recording.
    """
    best = Showcase(recording=recordings[0], index=len(recordings[0].frame_times_us) // 2)
    most: tuple[float, ...] = ()
    for recording in recordings:
        start = int(np.searchsorted(recording.frame_times_us, recording.frame_times_us[0] + 10**6))
        for index in range(start, len(recording.frame_times_us)):
            if recording.tracks is None:
                break
            shown = Showcase(recording=recording, index=index)
            truth = shown.truth(protocol)
            sides = truth.corners[:, 2:] - truth.corners[:, :2]
            count = len(truth.labels)
            worth = (
                len(set(truth.labels.tolist())),
                -touching_pairs(truth.corners),
                -abs(count - WELCOME_BOXES),
                sides.prod(1).sum(),
            )
            if worth > most:
                best, most = shown, worth
    return best


def touching_pairs(corners: NDArray[np.floating]) -> int:
    """How many pairs of boxes (left, top, right, bottom) share some of the picture.

    Example:
        >>> touching_pairs(np.array([[0, 0, 4, 4], [3, 3, 6, 6], [6, 0, 8, 2]]))
        1
    """
    low = np.maximum(corners[:, None, :2], corners[None, :, :2])
    high = np.minimum(corners[:, None, 2:], corners[None, :, 2:])
    return int(np.triu((high > low).all(-1), k=1).sum())


def detections(showcase: Showcase, run: Run, protocol: LabelProtocol) -> Boxes:
    """What a trained detector finds in the real events at the instant, having seen all before."""
    recording = showcase.recording
    found = detections_over(run, recording, recording.events_path, protocol)
    return next(islice(found, showcase.index - 1, None))  # the first is the second frame's


def around(showcase: Showcase, sources: Mapping[str, EventSource]) -> dict[str, Events]:
    """Every source's events over the seconds before the instant, for rates over time."""
    return {name: showcase.events(source, RATE_SPAN_US) for name, source in sources.items()}
