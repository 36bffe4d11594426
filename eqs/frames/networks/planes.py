"""Frames as tensors and back: the planes that a network takes, and a size that it can halve."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

Frame = NDArray[Any]
# Two frames (N, C, H, W), levels 0 to 1, and shares of the way between them: the frames there.
Network = Callable[[Tensor, Tensor, Sequence[float]], Iterator[Tensor]]
# The same for frames (H, W) or (H, W, 3), levels 0 to 255.
Between = Callable[[Frame, Frame, Sequence[float]], list[Frame]]

SIDES_PX = 64  # sides are padded to multiples of this: the most that a network here reduces them by
PLANES = {1: 1, 2: 1, 3: 3, 6: 3}  # planes a frame, by the channels that a first convolution takes


def on_frames(network: Network, channels: int | None) -> Between:
    """A network of tensors as one of frames.

    Args:
        network: what it does to tensors.
        channels: those that its first convolution takes: 1 or 2 where it sees grey frames, 3 or 6
            where it sees colour. Grey frames are repeated for a network of colours, whose results
            are averaged; colours go through a network of grey one by one. Any other number, or
            None, says nothing, and frames go through as they are.

    Raises:
        ValueError: when it is used, the network does not make frames of the size of its own.
    """
    planes = PLANES.get(channels) if channels is not None else None

    @torch.inference_mode()
    def between(first: Frame, second: Frame, shares: Sequence[float]) -> list[Frame]:
        height, width = first.shape[:2]
        pair = [padded(tensor_of(frame, planes)) for frame in (first, second)]
        made = []
        for tensor in network(pair[0], pair[1], shares):
            if not isinstance(tensor, Tensor) or tensor.shape != pair[0].shape:
                got = tuple(tensor.shape) if isinstance(tensor, Tensor) else type(tensor).__name__
                raise ValueError(
                    f"Expected a network that makes one tensor {tuple(pair[0].shape)} of two such, "
                    f"got {got}; set interpolation.inner.network to another"
                )
            made.append(frame_of(tensor[..., :height, :width], grey=first.ndim == 2))
        return made

    return between


def tensor_of(frame: Frame, planes: int | None) -> Tensor:
    """A frame (H, W) or (H, W, 3), levels 0 to 255, as (N, C, H, W), levels 0 to 1.

    Example:
        >>> grey, colour = np.zeros((4, 5)), np.zeros((4, 5, 3))
        >>> [tuple(tensor_of(grey, planes).shape) for planes in (1, 3, None)]
        [(1, 1, 4, 5), (1, 3, 4, 5), (1, 1, 4, 5)]
        >>> [tuple(tensor_of(colour, planes).shape) for planes in (1, 3, None)]
        [(3, 1, 4, 5), (1, 3, 4, 5), (1, 3, 4, 5)]
    """
    channels = frame[None] if frame.ndim == 2 else np.moveaxis(frame, -1, 0)
    tensor = torch.from_numpy(np.ascontiguousarray(channels, np.float32)) / 255.0
    if planes == 1:
        return tensor[:, None]
    if planes == 3 and len(tensor) == 1:
        tensor = tensor.expand(3, -1, -1)
    return tensor[None]


def frame_of(tensor: Tensor, *, grey: bool) -> Frame:
    """What a network made, (N, C, H, W), as a frame: planes averaged if it is to be grey."""
    planes = 255.0 * tensor.flatten(0, 1)
    return (planes.mean(0) if grey else planes.movedim(0, -1)).numpy()


def padded(tensor: Tensor) -> Tensor:
    """The tensor with its last columns and rows repeated up to multiples of `SIDES_PX`."""
    height, width = tensor.shape[-2:]
    more = (0, -width % SIDES_PX, 0, -height % SIDES_PX)
    return functional.pad(tensor, more, mode="replicate") if any(more) else tensor


def warped(image: Tensor, flow: Tensor) -> Tensor:
    """The image read at every pixel's place plus its flow, bilinear, edges repeated.

    Convention: corners are pixels' middles (`align_corners=True`), so that a flow of zero gives the
    image itself; some programs divide by the width instead and shift it by half a pixel.

    Args:
        image: shape (N, C, H, W).
        flow: right and down, pixels, shape (N, 2, H, W).
    """
    height, width = image.shape[-2:]
    rows = torch.arange(height, dtype=flow.dtype)[None, :, None] + flow[:, 1]
    columns = torch.arange(width, dtype=flow.dtype)[None, None, :] + flow[:, 0]
    grid = torch.stack([2 * columns / (width - 1) - 1, 2 * rows / (height - 1) - 1], dim=-1)
    return functional.grid_sample(
        image, grid, mode="bilinear", padding_mode="border", align_corners=True
    )
