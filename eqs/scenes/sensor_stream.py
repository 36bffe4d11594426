"""What the recordings of every event camera here share: steps of the scene, and a readout."""

from __future__ import annotations

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from eqs.events import Events
from eqs.scenes.circuit import Array, read_out


@dataclass(frozen=True, kw_only=True)
class EventSensor(ABC):
    """An event camera that is fed with light, never with frames: its parameters, nothing else.

    Args:
        threshold_on_log: mean ON threshold, natural-log contrast.
        threshold_off_log: mean OFF threshold, natural-log contrast, positive.
        threshold_mismatch_log: standard deviation of a pixel's threshold over the array.
        step_us: time between two renderings of the scene, us.
        seed: draws the fixed pattern of mismatch; one seed is one sensor.
    """

    scales: ClassVar[Mapping[str, Mapping[str, float]]] = {}
    """What one can have more or less of: by its name, parameters and the powers they go with."""

    threshold_on_log: float
    threshold_off_log: float
    threshold_mismatch_log: float
    step_us: int = 1000
    seed: int = 0

    def scaled(self, quantity: str, factor: float) -> Self:
        """The same camera with so many times of something, one of `scales`.

        Example:
            >>> from eqs.scenes import ReferenceSensor
            >>> ReferenceSensor().scaled("contrast", 2.0).threshold_on_log
            0.446
        """
        powers = self.scales[quantity].items()
        changed: dict[str, Any] = {
            name: getattr(self, name) * factor**power for name, power in powers
        }
        return replace(self, **changed)

    def definition_hash(self) -> str:
        """Twelve hexadecimal digits that change with any parameter."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    @abstractmethod
    def start(
        self, height: int, width: int, *, noise_key: tuple[int, ...], start_us: int = 0
    ) -> SensorStream:
        """Switch the sensor on; `noise_key` names the recording and thereby its noise."""

    def require(self, *positive: str) -> None:
        """Refuse values that no circuit has.

        Args:
            *positive: parameters that must not be 0 either.

        Raises:
            ValueError: a parameter is negative, or one of these is 0.
        """
        for name, value in asdict(self).items():
            if not value >= 0:
                raise ValueError(f"Expected {name} >= 0, got {value}; set scene.sensor.{name}")
        for name in positive:
            if not getattr(self, name) > 0:
                raise ValueError(f"Expected {name} > 0, got 0; set scene.sensor.{name}")


class SensorStream(ABC):
    """One recording: the state of every pixel and of the readout.

    Convention: picture k of a recording is the light at `start_us + k step_us`. Feeding the
    pictures one by one or in any groups gives the same events.

    Args:
        sensor: the camera.
        height: rows of the sensor.
        width: columns of the sensor.
        rows: numbers that a pixel remembers from step to step.
        row_service_us: time the readout spends on one row, us.
        noise_key: names the recording and thereby its noise.
        start_us: time of the first picture, us.
    """

    def __init__(
        self,
        sensor: EventSensor,
        height: int,
        width: int,
        *,
        rows: int,
        row_service_us: float,
        noise_key: tuple[int, ...],
        start_us: int,
    ) -> None:
        """Draw the thresholds, the first part of the fixed pattern; a picture settles the rest."""
        self._height, self._width, self._start_us = height, width, start_us
        self._step_us, self._row_service_us = sensor.step_us, row_service_us
        count = height * width
        self._pattern = np.random.default_rng(np.random.SeedSequence([sensor.seed, height, width]))
        spread = sensor.threshold_mismatch_log * self._pattern.standard_normal((2, count))
        floor = 0.2 * min(sensor.threshold_on_log, sensor.threshold_off_log)
        means = np.array([[sensor.threshold_on_log], [sensor.threshold_off_log]])
        self._thresholds = np.maximum(means + spread, floor).astype(np.float32)
        keys = np.random.SeedSequence([sensor.seed, *noise_key]).generate_state(2, np.uint64)
        self._key, self._phase_seed = np.uint64(keys[0]), int(keys[1])
        self._state = np.zeros((rows, count), np.float32)
        # Buffers that a step reuses: the state to be, and room for the step's events.
        self._trial, self._room = self._state.copy(), np.empty((count, 4))
        self._steps = -1
        self._pending = np.zeros((0, 4))
        self._bus = np.array([-1.0, -1.0])  # when the readout is free, and the row it serves

    def step(self, pictures: NDArray[np.float32]) -> Events:
        """Feed pictures (n, H, W) in lux; returns the events that can no longer change.

        Raises:
            ValueError: the pictures have another size, or a value is negative or not finite.
        """
        if pictures.shape[1:] != (self._height, self._width):
            raise ValueError(
                f"Expected pictures of {self._width}x{self._height}, got shape {pictures.shape}; "
                "start the sensor with the scene's size"
            )
        if not (np.isfinite(pictures).all() and (pictures >= 0).all()):
            raise ValueError("Expected finite light >= 0 lux, got other values; check the scene")
        found = [self._pending]
        for picture in pictures.reshape(len(pictures), -1).astype(np.float32, copy=False):
            if self._steps < 0:
                self._settle(picture)
            else:
                found.append(self._advance(picture))
            self._steps += 1
        self._pending = np.concatenate(found)
        return self._deliver(max(self._steps, 0) * float(self._step_us))

    def finish(self) -> Events:
        """The events still waiting for the readout."""
        return self._deliver(np.inf)

    @abstractmethod
    def _settle(self, picture: NDArray[np.float32]) -> None:
        """Put every pixel into the state that the first picture leaves it in."""

    @abstractmethod
    def _run(self, picture: NDArray[np.float32], state: NDArray[np.float32], room: Array) -> int:
        """Advance `state` by one step and write (time us, x, y, p) rows; how many there are."""

    def _memories(
        self, output: NDArray[np.float32], random: np.random.Generator
    ) -> NDArray[np.float32]:
        """What pixels memorised before a recording began: each is between its thresholds."""
        on, off = self._thresholds
        place = random.random(len(output), dtype=np.float32)
        memories: NDArray[np.float32] = output - on + place * (on + off)
        return memories

    def _advance(self, picture: NDArray[np.float32]) -> Array:
        while True:
            np.copyto(self._trial, self._state)
            count = self._run(picture, self._trial, self._room)
            if count <= len(self._room):
                self._state, self._trial = self._trial, self._state
                return self._room[:count].copy()
            self._room = np.empty((2 * count, 4))

    def _deliver(self, until_us: float) -> Events:
        """Pass on the requests made before `until_us`, in the order they were made."""
        ready = self._pending[:, 0] < until_us
        due, self._pending = self._pending[ready], self._pending[~ready]
        due = due[np.lexsort((due[:, 1], due[:, 2], due[:, 0]))]
        times = read_out(due, self._bus, self._row_service_us)
        return Events(
            t=times + np.int64(self._start_us),
            x=due[:, 1].astype(np.uint16),
            y=due[:, 2].astype(np.uint16),
            p=due[:, 3].astype(np.uint8),
            height=self._height,
            width=self._width,
        )
