"""Frames between the frames, by optical flow."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.extras import needed
from eqs.frames.interpolation import (
    Frame,
    displacement_factor,
    require_factor,
    shares,
    stacked,
)
from eqs.frames.luma import luma

Flow = NDArray[np.float32]
TRUSTED_PX = 1.0  # forward and backward flow that disagree by more count little
LEAST_TRUST = 1e-3
LEAST_SIDE_PX = 16  # the search finds nothing in smaller images; their edges are repeated


@dataclass(frozen=True, kw_only=True)
class FlowInterpolation:
    """Moves both frames along the optical flow and blends them where they can be trusted.

    The flow is OpenCV's dense inverse search. Flows to an instant between the frames follow Super
    SloMo's formula; instead of its second network, the agreement of forward and backward flow
    says how far each frame can be trusted at a pixel.

    Args:
        largest_step_px: with `factor` unset, as many frames as keep every displacement between
            neighbours to this.
        factor: frames out per frame in, whatever moves; None for as many as needed.
        most_frames: the most frames out per frame in.

    Raises:
        ValueError: a number is out of range, or OpenCV, the optional dependency `flow`, is not
            installed.

    Source: Jiang et al., "Super SloMo", CVPR 2018, equation 4; Gehrig et al., "Video to Events",
    CVPR 2020, section 3.1; Kroeger et al., "Fast Optical Flow using Dense Inverse Search", ECCV
    2016.
    """

    largest_step_px: float = 1.0
    factor: int | None = None
    most_frames: int = 64

    def __post_init__(self) -> None:
        """Check the numbers and that OpenCV is there."""
        if self.factor is not None:
            require_factor(self.factor)
        require_factor(self.most_frames)
        if not self.largest_step_px > 0:
            raise ValueError(
                f"Expected largest_step_px above 0, got {self.largest_step_px!r}; "
                "set interpolation.largest_step_px"
            )
        with needed("flow", "for optical flow (interpolation=linear needs none)"):
            import cv2  # noqa: F401

    def between(self, first: Frame, second: Frame) -> Frame:
        """See `Interpolation`."""
        forward, backward = optical_flow(first, second), optical_flow(second, first)
        largest = max(float(np.linalg.norm(flow, axis=-1).max()) for flow in (forward, backward))
        factor = self.factor or displacement_factor(largest, self.largest_step_px, self.most_frames)
        trust = agreement(forward, backward), agreement(backward, forward)
        made = [
            frame_at(first, second, share, (forward, backward), trust) for share in shares(factor)
        ]
        return stacked(first, made)

    def parameters(self) -> dict[str, Any]:
        """See `Interpolation`."""
        return {"kind": "flow", **asdict(self)}


def optical_flow(first: Frame, second: Frame) -> Flow:
    """Displacement (H, W, 2) in pixels, right and down, of every pixel of the first frame."""
    import cv2

    grey = [frame if frame.ndim == 2 else luma(frame) for frame in (first, second)]
    grey = [np.rint(frame).astype(np.uint8) for frame in grey]
    height, width = grey[0].shape
    more = [(0, max(0, LEAST_SIDE_PX - side)) for side in (height, width)]
    first_grey, second_grey = (np.pad(each, more, mode="edge") for each in grey)
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    start = np.zeros((*first_grey.shape, 2), np.float32)
    found = np.asarray(search.calc(first_grey, second_grey, start), np.float32)
    return np.ascontiguousarray(found[:height, :width])


def moved(image: Frame, flow: Flow) -> Frame:
    """The image read at every pixel's place plus its flow, bilinear, edges repeated."""
    import cv2

    rows, columns = np.indices(flow.shape[:2], dtype=np.float32)
    return cv2.remap(
        image.astype(np.float32),
        columns + flow[..., 0],
        rows + flow[..., 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )


def agreement(there: Flow, back: Flow) -> NDArray[np.float32]:
    """How well each pixel comes back when it follows one flow and then the other, in (0, 1]."""
    miss = np.linalg.norm(there + moved(back, there), axis=-1) / TRUSTED_PX
    trust: Flow = np.maximum(np.exp(-(miss**2)), LEAST_TRUST).astype(np.float32)
    return trust


def frame_at(
    first: Frame,
    second: Frame,
    share: float,
    flows: tuple[Flow, Flow],
    trust: tuple[NDArray[np.float32], NDArray[np.float32]],
) -> NDArray[np.float32]:
    """The frame at a share of the way from the first to the second."""
    forward, backward = flows
    to_first = -(1.0 - share) * share * forward + share**2 * backward
    to_second = (1.0 - share) ** 2 * forward - share * (1.0 - share) * backward
    weights = (
        (1.0 - share) * moved(trust[0], to_first),
        share * moved(trust[1], to_second),
    )
    parts = moved(first, to_first), moved(second, to_second)
    if first.ndim == 3:
        weights = (weights[0][..., None], weights[1][..., None])
    total = weights[0] * parts[0] + weights[1] * parts[1]
    return (total / (weights[0] + weights[1])).astype(np.float32)
