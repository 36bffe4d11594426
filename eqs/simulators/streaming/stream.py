"""One run of a simulator: frames come in chunks, events leave in order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from eqs.events import Events
from eqs.frames import (
    WHITE,
    GreyImage,
    Interpolation,
    Lens,
    LightSource,
    checked_frames,
    checked_times,
)
from eqs.processors import useful_bands
from eqs.simulators.streaming.bands import BandedPixels
from eqs.simulators.streaming.keys import MAX_PIXELS, MAX_TIME_US, ReorderBuffer, events_of, ordered
from eqs.simulators.streaming.pixels import Interval, Pixels
from eqs.simulators.streaming.readout import Readout, WaitingEvents


class Model(Protocol):
    """What a stream asks of a simulator, see `Simulator`."""

    @property
    def mode(self) -> str: ...  # noqa: D102

    @property
    def interpolation(self) -> Interpolation | None: ...  # noqa: D102

    @property
    def readout(self) -> Readout | None: ...  # noqa: D102

    @property
    def light(self) -> LightSource | None: ...  # noqa: D102

    @property
    def lens(self) -> Lens | None: ...  # noqa: D102

    @property
    def rounds_luma(self) -> bool: ...  # noqa: D102

    @property
    def in_bands(self) -> bool: ...  # noqa: D102

    def begin(self, image: GreyImage, sequence: str) -> Pixels:
        """The pixels after the first frame of a sequence."""


class Stream:
    """One run of a simulator over one sequence.

    The events of all `step`s and of `finish`, joined, are the same bit for bit however the frames
    are divided into chunks. A stream can be pickled between steps and go on elsewhere.
    """

    def __init__(self, simulator: Model, sequence: str, white: float | None = None) -> None:
        """See `Simulator.start`."""
        self.simulator = simulator
        self.white = white
        self._brightest = 0.0  # of floating frames whose white level nobody told
        self.sequence = sequence
        self._pixels: Pixels | None = None
        self._buffer = ReorderBuffer()
        self._waiting: WaitingEvents | None = None
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
        array = checked_frames(frames, WHITE if self.white is None else self.white)
        if self.white is None and array.dtype.kind == "f":
            self._brightest = max(self._brightest, float(array.max(initial=0)))
        times = checked_times(timestamps_us, len(array))
        self._check_continues(array.shape[1:3], times)
        # One frame's events are put in order while the pixels already see the next frame.
        with ThreadPoolExecutor(1) as behind:
            released = [
                behind.submit(self._released, *self._fired(each, at))
                for frame, time in zip(array, times, strict=True)
                for each, at in self._with_those_between(frame, int(time))
            ]
        return self._events([part.result() for part in released])

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

    @property
    def span_us(self) -> tuple[int, int]:
        """Times of the first and of the last frame so far, microseconds."""
        return self._origin_us, self._last_us

    def finish(self) -> Events:
        """End the sequence and give the events that were held back.

        Raises:
            ValueError: fewer than two frames were seen, floating ones seem to take 1 for white, or
                the readout is far too slow.
        """
        if self._frames_seen < 2:
            raise ValueError(
                f"Expected a clip of at least two frames, got {self._frames_seen}; events arise "
                "between frames"
            )
        if 0 < self._brightest <= 1:
            raise ValueError(
                f"Expected floating frames with grey levels from 0 to 255, got none brighter than "
                f"{self._brightest:g}; set white=1 if 1 is white, or white=255 if it was that dark"
            )
        self._finished = True
        keys = self._buffer.flush()
        return self._events([keys if self._waiting is None else self._waiting.flush(keys)])

    def _events(self, parts: Sequence[NDArray[np.int64]]) -> Events:
        height, width = self._size
        return events_of(parts, height, width, self._origin_us)

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

    def _fired(self, frame: NDArray[Any], time_us: int) -> tuple[NDArray[np.int64], Interval]:
        """Keys of the events between the last frame and this one, and their interval."""
        image = self._seen(frame)
        index, self._frames_seen = self._frames_seen, self._frames_seen + 1
        if self._pixels is None:
            self._origin_us = self._last_us = time_us
            self._pixels = self._first_pixels(image)
            if self.simulator.readout is not None:
                self._waiting = WaitingEvents(self.simulator.readout, self._size)
            return np.empty(0, np.int64), Interval(0, 0, 0)
        interval = Interval(index, self._last_us - self._origin_us, time_us - self._origin_us)
        self._last_us = time_us
        return self._pixels.advance(image, interval).copy(), interval

    def _seen(self, frame: NDArray[Any]) -> GreyImage:
        """What reaches the pixels of a frame."""
        light, lens = self.simulator.light, self.simulator.lens
        image = (GreyImage.from_frame if light is None else light.image)(
            frame, self.simulator.rounds_luma
        )
        return image if lens is None else lens.seen(image)

    def _first_pixels(self, image: GreyImage) -> Pixels:
        begin = partial(self.simulator.begin, sequence=self.sequence)
        side_by_side = self.simulator.in_bands and self.simulator.mode == "fixed"
        bands = useful_bands(image.codes.size) if side_by_side else 1
        return begin(image) if bands == 1 else BandedPixels(begin, image, bands)

    def _released(self, keys: NDArray[np.int64], interval: Interval) -> NDArray[np.int64]:
        """Keys of the events that the end of an interval makes final."""
        keys = ordered(keys, interval.start_us)
        keys = self._buffer.push(keys, interval.stop_us)
        if self._waiting is not None:
            keys = self._waiting.push(keys, interval.stop_us)
        return keys
