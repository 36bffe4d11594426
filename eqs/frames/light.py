"""The light behind display values: what an event camera sees of a picture made for a screen.

Source: IEC 61966-2-1 (sRGB), ITU-R BT.709 for the luminance of linear red, green and blue, and
Han et al., "Physical-Based Event Camera Simulator", ECCV 2024, for what a photodiode makes of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from eqs.frames.luma import GREY_LEVELS, GreyImage

LUMA = "luma"
# What a display's red, green and blue add to the light. A photodiode's are those of a nearly flat
# quantum efficiency from 400 to 700 nm: it sees three and a half times as much blue as the eye.
CHANNEL_WEIGHTS = {
    "bt709": (0.2126, 0.7152, 0.0722),
    "photodiode": (0.317 / 0.999, 0.288 / 0.999, 0.394 / 0.999),
}
WHITE_LEVEL = 255.0


def srgb_to_linear(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear light of sRGB values, both in [0, 1].

    Example:
        >>> srgb_to_linear(np.array([0.0, 0.5, 1.0])).round(4).tolist()
        [0.0, 0.214, 1.0]
    """
    low = values / 12.92
    return np.where(values <= 0.04045, low, ((np.maximum(values, 0) + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """SRGB values of linear light, both in [0, 1]; what is brighter is cut off.

    Example:
        >>> linear_to_srgb(np.array([0.0, 0.214, 1.0])).round(3).tolist()
        [0.0, 0.5, 1.0]
    """
    light = np.clip(values, 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)


def gamma22_to_linear(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear light of values with an exponent of 1 / 2.2, both in [0, 1]."""
    return np.maximum(values, 0) ** 2.2


CURVES: dict[str, Callable[[NDArray[np.float64]], NDArray[np.float64]]] = {
    "srgb": srgb_to_linear,
    "gamma22": gamma22_to_linear,
}


class LightSource(Protocol):
    """Gives simulators the light of a frame."""

    @property
    def curve(self) -> str:
        """What it is called."""

    @property
    def caveat(self) -> str:
        """Why who sees it is no simulator like others; empty where it is one."""

    def parameters(self) -> dict[str, Any]:
        """Everything that changes the events, as plain values."""

    def image(self, frame: NDArray[Any], rounded_luma: bool = True) -> GreyImage:
        """The light of a checked frame."""


@runtime_checkable
class LightOfScenes(Protocol):
    """Light that comes with a recording instead of from its frames."""

    def clip(
        self, folder: Path, frame_times_us: NDArray[np.int64]
    ) -> Iterator[tuple[NDArray[np.float32], NDArray[np.int64]]]:
        """Frames to simulate a recording from, and their times, in chunks."""


@dataclass(frozen=True, kw_only=True)
class Light:
    """Undoes the curve that a frame camera put its levels on, before a simulator sees them.

    Convention: levels stay between 0 and 255, of which 255 is the light of white. Frames that are
    made in between are made of display values, which is what such networks are trained on.

    Args:
        curve: `srgb` or `gamma22`.
        black_level: level of no light; what is darker counts as that.
        weights: `luma` undoes the curve of the grey value that the simulator computes; `bt709` and
            `photodiode` undo that of red, green and blue, and add their light as an eye or as
            silicon sees it.

    Raises:
        ValueError: the curve or the weights are none of these, or nothing is brighter than black.
    """

    caveat: ClassVar[str] = ""

    curve: str = "srgb"
    black_level: float = 0.0
    weights: str = LUMA

    def __post_init__(self) -> None:
        """Check the choices."""
        if self.curve not in CURVES:
            raise ValueError(
                f"Expected a curve among {', '.join(CURVES)}, got {self.curve!r}; set light.curve"
            )
        if self.weights not in (LUMA, *CHANNEL_WEIGHTS):
            raise ValueError(
                f"Expected weights among luma, {', '.join(CHANNEL_WEIGHTS)}, got "
                f"{self.weights!r}; set light.weights"
            )
        if not 0 <= self.black_level < WHITE_LEVEL:
            raise ValueError(
                f"Expected a black level from 0 to below 255, got {self.black_level}; set "
                "light.black_level"
            )

    def parameters(self) -> dict[str, Any]:
        """What changes the events."""
        return {
            "curve": self.curve, "black_level": self.black_level, "weights": self.weights
        }  # fmt: skip

    def levels(self, levels: NDArray[Any]) -> NDArray[np.float64]:
        """Levels of light of display levels, both 0..255.

        Example:
            >>> Light().levels(np.array([0, 188, 255])).round(1).tolist()
            [0.0, 128.2, 255.0]
        """
        above = np.maximum(levels.astype(np.float64) - self.black_level, 0.0)
        return WHITE_LEVEL * CURVES[self.curve](above / (WHITE_LEVEL - self.black_level))

    def image(self, frame: NDArray[Any], rounded_luma: bool = True) -> GreyImage:
        """The light of a checked frame, grey `(H, W)` or colour `(H, W, 3)`.

        Eight bits keep their table of 256 levels, so that most frames cost nothing.
        """
        if frame.ndim == 3 and self.weights != LUMA:
            weights = CHANNEL_WEIGHTS[self.weights]
            if frame.dtype == np.uint8:
                table = self.levels(GREY_LEVELS)
                light = [weights[k] * table[frame[..., k]] for k in range(3)]
            else:
                light = [weights[k] * self.levels(frame[..., k]) for k in range(3)]
            return GreyImage.from_frame(light[0] + light[1] + light[2])
        grey = GreyImage.from_frame(frame, rounded_luma)
        return replace(grey, levels=self.levels(grey.levels))
