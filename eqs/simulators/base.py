"""What every simulator is: parameters, and a stream that turns frames into events."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from eqs.events import Events
from eqs.frames import GreyImage, Interpolation, checked_frames, checked_times
from eqs.simulators.ordering import MAX_PIXELS, MAX_TIME_US, ReorderBuffer, events_of, ordered

MODES = ("fixed", "faithful")


class Interval(NamedTuple):
    """The time between two frames, on a clock that starts at the first frame."""

    frame: int
    """Number of the later frame, from 0."""
    start_us: int
    stop_us: int

    @property
    def span_us(self) -> int:
        """Length of the interval."""
        return self.stop_us - self.start_us


class Pixels(Protocol):
    """The state of all pixels of a sensor."""

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Move to the image at the end of the interval and give the keys of its events.

        No event may come before `interval.start_us`, now or later. Events should be written row by
        row, a pixel's own in the order of their times, which makes sorting them cheap.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class Simulator(ABC):
    """A model of an event camera that sees a clip of frames.

    A subclass is a frozen dataclass of parameters with units in their names, and a `begin` that
    makes the pixels. All checking, conversion to grey, sorting and chunking happens here.

    Convention: frames are grey or RGB with levels 0..255, their times int64 microseconds; event
    times are floored to whole microseconds; the stream is ordered by (t, y, x, ordinal). The first
    frame only sets the state.

    Args:
        mode: `fixed` mends the defects of the published program, `faithful` keeps them.
        interpolation: makes frames between those of the clip, which the model then sees as well.

    Raises:
        ValueError: a parameter lies outside its range.
    """

    name: ClassVar[str]
    version: ClassVar[int] = 1
    """Raised whenever equal parameters begin to give other events."""
    rounds_luma: ClassVar[bool] = True
    """Whether 8-bit colour becomes 8-bit grey, or grey with fractions."""

    mode: str = "fixed"
    interpolation: Interpolation | None = None

    def __post_init__(self) -> None:
        """Check the parameters every simulator has."""
        if self.mode not in MODES:
            raise ValueError(f"Expected mode fixed or faithful, got {self.mode!r}; set sim.mode")

    @property
    def stochastic(self) -> bool:
        """Whether the events depend on the seed."""
        return False

    @abstractmethod
    def begin(self, image: GreyImage, sequence: str) -> Pixels:
        """The pixels after the first frame of a sequence."""

    def parameters(self) -> dict[str, Any]:
        """Everything that changes the events; seed and interpolation only where they do."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        if self.interpolation is None:
            del values["interpolation"]
        else:
            values["interpolation"] = self.interpolation.parameters()
        if not self.stochastic:
            values.pop("seed", None)
        return values

    def start(self, sequence: str = "") -> Stream:
        """A stream that takes the frames in chunks of any size.

        Args:
            sequence: name of the recording. Noise over time differs between names; what belongs
                to the sensor, as the mismatch of its thresholds, does not.
        """
        return Stream(self, sequence)

    def simulate(self, frames: NDArray[Any], timestamps_us: Any, sequence: str = "") -> Events:  # noqa: ANN401
        """The events of a whole clip.

        Args:
            frames: `(N, H, W)` grey or `(N, H, W, 3)` RGB, uint8 or floating, levels 0..255.
            timestamps_us: time of each frame, strictly increasing, int64 microseconds.
            sequence: name of the recording, see `start`.

        Raises:
            ValueError: the clip has fewer than two frames, or is none.
        """
        stream = self.start(sequence)
        return Events.concatenate([stream.step(frames, timestamps_us), stream.finish()])


class Stream:
    """One run of a simulator over one sequence.

    The events of all `step`s and of `finish`, joined, are the same bit for bit however the frames
    are divided into chunks. A stream can be pickled between steps and go on elsewhere.
    """

    def __init__(self, simulator: Simulator, sequence: str) -> None:
        """See `Simulator.start`."""
        self.simulator = simulator
        self.sequence = sequence
        self._pixels: Pixels | None = None
        self._buffer = ReorderBuffer()
        self._frames_seen = 0
        self._last_frame: NDArray[Any] | None = None
        self._origin_us = 0
        self._last_us = 0
        self._size = (0, 0)
        self._finished = False

    def step(self, frames: NDArray[Any] | Sequence[Any], timestamps_us: Any) -> Events:  # noqa: ANN401
        """Take the next frames and give the events that are final.

        Raises:
            ValueError: the frames are none, differ in size from earlier ones, or do not come after
                them.
        """
        if self._finished:
            raise ValueError("Expected frames before the end, got some after finish(); start anew")
        array = checked_frames(frames)
        times = checked_times(timestamps_us, len(array))
        self._check_continues(array.shape[1:3], times)
        keys = [
            self._advance(each, at)
            for frame, time in zip(array, times, strict=True)
            for each, at in self._with_those_between(frame, int(time))
        ]
        return self._events(np.concatenate(keys) if keys else np.empty(0, np.int64))

    def _with_those_between(
        self, frame: NDArray[Any], time_us: int
    ) -> Iterator[tuple[NDArray[Any], int]]:
        """The frames since the last one, where the simulator interpolates, and then the frame."""
        interpolation, last = self.simulator.interpolation, self._last_frame
        if interpolation is not None:
            self._last_frame = frame.copy()
            between = frame[None][:0] if last is None else interpolation.between(last, frame)
            span_us, parts = time_us - self._last_us, len(between) + 1
            for k, made in enumerate(between, start=1):
                at = time_us - span_us + k * span_us // parts
                if self._last_us < at < time_us:  # a short interval has no room for all of them
                    yield made, at
        yield frame, time_us

    def finish(self) -> Events:
        """End the sequence and give the events that were held back.

        Raises:
            ValueError: fewer than two frames were seen.
        """
        if self._frames_seen < 2:
            raise ValueError(
                f"Expected a clip of at least two frames, got {self._frames_seen}; events arise "
                "between frames"
            )
        self._finished = True
        return self._events(self._buffer.flush())

    def _events(self, keys: NDArray[np.int64]) -> Events:
        height, width = self._size
        return events_of(keys, height, width, self._origin_us)

    def _check_continues(self, size: tuple[int, ...], times: NDArray[np.int64]) -> None:
        height, width = size
        if self._size == (0, 0):
            if height * width > MAX_PIXELS or max(height, width) > 65535:
                raise ValueError(f"Expected at most {MAX_PIXELS} pixels, got {width}x{height}")
            self._size = (height, width)
        if (height, width) != self._size:
            raise ValueError(
                f"Expected frames of one size, got {width}x{height} after "
                f"{self._size[1]}x{self._size[0]}; resize them or start a new stream"
            )
        if not len(times):
            return
        if self._frames_seen and times[0] <= self._last_us:
            raise ValueError(
                f"Expected frame times that increase, got {times[0]} us after {self._last_us} us "
                "from the chunk before; give the chunks in order and without overlap"
            )
        origin = self._origin_us if self._frames_seen else int(times[0])
        if int(times[-1]) - origin >= MAX_TIME_US:
            raise ValueError(
                f"Expected a clip of less than {MAX_TIME_US} us, got {int(times[-1]) - origin} us; "
                "check the unit of the frame times or start a new stream"
            )

    def _advance(self, frame: NDArray[Any], time_us: int) -> NDArray[np.int64]:
        """Keys of the events that the frame makes final."""
        image = GreyImage.from_frame(frame, self.simulator.rounds_luma)
        index, self._frames_seen = self._frames_seen, self._frames_seen + 1
        if self._pixels is None:
            self._origin_us = self._last_us = time_us
            self._pixels = self.simulator.begin(image, self.sequence)
            return np.empty(0, np.int64)
        interval = Interval(index, self._last_us - self._origin_us, time_us - self._origin_us)
        self._last_us = time_us
        keys = ordered(self._pixels.advance(image, interval), interval.start_us)
        return self._buffer.push(keys, interval.stop_us)


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """No simulator: the recorded events themselves, which stand in the study as `sim=real`."""

    name: ClassVar[str] = "real"
    version: ClassVar[int] = 1

    def parameters(self) -> dict[str, Any]:
        """Nothing to set."""
        return {}


def require_positive(simulator: Simulator, *names: str) -> None:
    """Refuse parameters that are not finite numbers above zero."""
    for name in names:
        value = getattr(simulator, name)
        if not (isinstance(value, int | float) and 0 < value < np.inf):
            raise ValueError(f"Expected {name} above 0, got {value!r}; set sim.{name}")


def require_not_negative(simulator: Simulator, *names: str) -> None:
    """Refuse parameters that are not finite numbers from zero up."""
    for name in names:
        value = getattr(simulator, name)
        if not (isinstance(value, int | float) and 0 <= value < np.inf):
            raise ValueError(f"Expected {name} of 0 or more, got {value!r}; set sim.{name}")
