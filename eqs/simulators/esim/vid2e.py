"""Vid2E: ESIM on frames that lie at most a pixel of motion apart.

Gehrig, Gehrig, Hidalgo-Carrio and Scaramuzza, "Video to Events: Recycling Video Datasets for Event
Cameras", CVPR 2020.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from eqs.frames import FlowInterpolation
from eqs.simulators.esim.parameters import ESIM


@dataclass(frozen=True, kw_only=True)
class Vid2E(ESIM):
    """ESIM on an upsampled clip; see there for the model and its parameters.

    The paper's interpolator is a trained network (Super SloMo). Without its weights the frames
    are moved along an optical flow, as many as keep every displacement to a pixel; a network of
    one's own takes its place as `interpolation`.

    Args:
        interpolation: None for optical flow with steps of at most a pixel.

    Raises:
        ValueError: mode is faithful, which would need the published network; or as for ESIM.
    """

    name: ClassVar[str] = "vid2e"

    log_offset: float = 1e-5

    def __post_init__(self) -> None:
        """Choose the interpolation and check the parameters."""
        super().__post_init__()
        if self.mode != "fixed":
            raise ValueError(
                f"Expected mode fixed for vid2e, got {self.mode}: the published program needs the "
                "weights of its network; set sim.mode=fixed, and interpolation=network to bring one"
            )
        if self.interpolation is None:
            object.__setattr__(self, "interpolation", FlowInterpolation())
