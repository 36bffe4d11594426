"""What every simulator is: parameters, and the pixels they describe."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.events import Events
from eqs.frames import GreyImage, Interpolation, Lens, LightSource
from eqs.simulators.streaming.pixels import Pixels
from eqs.simulators.streaming.readout import Readout
from eqs.simulators.streaming.stream import Stream

MODES = ("fixed", "faithful")


@dataclass(frozen=True, kw_only=True)
class Simulator:
    """A model of an event camera that sees a clip of frames.

    A subclass is a frozen dataclass of parameters with units in their names, and names the pixels
    that they describe, one class for each mode. All checking, conversion to grey, sorting and
    chunking happens here.

    Convention: frames are grey or RGB with levels 0..255, their times int64 microseconds; event
    times are floored to whole microseconds; the stream is ordered by (t, y, x, ordinal). The first
    frame only sets the state.

    Args:
        mode: `fixed` mends the defects of the published program, `faithful` keeps them.
        interpolation: makes frames between those of the clip, which the model then sees as well.
        readout: makes the events wait until the sensor can send them; None sends them at once.
        light: turns display values into light, after the frames in between were made; None takes
            them as they are.
        lens: stands before the pixels; None lets them see each image as it is.

    Raises:
        ValueError: a parameter lies outside its range.
    """

    name: ClassVar[str]
    pixels: ClassVar[Mapping[str, Callable[[Any, GreyImage, str], Pixels]]]
    """Makes the pixels, by mode, from the simulator, the first image and the sequence's name."""
    version: ClassVar[int] = 1
    """Raised whenever equal parameters begin to give other events."""
    rounds_luma: ClassVar[bool] = True
    """Whether 8-bit colour becomes 8-bit grey, or grey with fractions."""
    in_bands: ClassVar[bool] = False
    """Whether parts of a sensor are simulated side by side in `fixed` mode. It takes pixels that go
    by their own light alone and draw with `first_pixel=image.first_pixel`, and pays where they
    compute more than they read."""

    mode: str = "fixed"
    interpolation: Interpolation | None = None
    readout: Readout | None = None
    light: LightSource | None = None
    lens: Lens | None = None

    def __post_init__(self) -> None:
        """Check the parameters every simulator has."""
        if self.mode not in MODES:
            raise ValueError(f"Expected mode fixed or faithful, got {self.mode!r}; set sim.mode")
        if self.mode not in self.pixels:
            raise ValueError(
                f"Expected mode fixed for {self.name}, got faithful, as it follows no published "
                "program; set sim.mode=fixed"
            )

    @property
    def stochastic(self) -> bool:
        """Whether the events depend on the seed."""
        return False

    def caveat(self, judge: str) -> str:
        """Why it is no simulator like others where a data set judges it; empty where it is one.

        Its rows are then marked, with this sentence's end below, and no point of a correlation.

        Args:
            judge: name of the data set.
        """
        return "" if self.light is None else self.light.caveat

    @property
    def setting(self) -> str:
        """What it sees of frames, in words: light, and frames in between."""
        words = ["display" if self.light is None else self.light.curve]
        if self.interpolation is not None:
            words.append(str(self.interpolation.parameters().get("kind", "interpolated")))
        return " ".join(words)

    def begin(self, image: GreyImage, sequence: str) -> Pixels:
        """The pixels after the first frame of a sequence."""
        return self.pixels[self.mode](self, image, sequence)

    def parameters(self) -> dict[str, Any]:
        """Everything that changes the events; what is not used is left out."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        for name in ("interpolation", "readout", "light", "lens"):
            part = values.pop(name)
            if part is not None:
                values[name] = part.parameters()
        if not self.stochastic:
            values.pop("seed", None)
        return values

    def start(self, sequence: str = "", white: float | None = None) -> Stream:
        """A stream that takes the frames in chunks of any size.

        Args:
            white: level that is white in floating frames. Untold it is 255, and a clip that is
                nowhere brighter than 1 is refused at its end, since it must have meant another.
            sequence: name of the recording. Noise over time differs between names; what belongs
                to the sensor, as the mismatch of its thresholds, does not.
        """
        return Stream(self, sequence, white)

    def simulate(
        self,
        frames: NDArray[Any],
        timestamps_us: Any,  # noqa: ANN401
        sequence: str = "",
        white: float | None = None,
    ) -> Events:
        """The events of a whole clip, with the time from its first to its last frame as their span.

        Args:
            frames: `(N, H, W)` grey or `(N, H, W, 3)` RGB, uint8 or floating, levels 0..255.
            timestamps_us: time of each frame, strictly increasing, int64 microseconds.
            sequence: name of the recording, see `start`.
            white: level that is white in floating frames, see `start`.

        Raises:
            ValueError: the clip has fewer than two frames, or is none, or its levels run to 1
                where nobody said that 1 is white.
        """
        stream = self.start(sequence, white)
        events = Events.concatenate([stream.step(frames, timestamps_us), stream.finish()])
        return replace(events, span_us=stream.span_us)


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
