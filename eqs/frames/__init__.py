"""Frames: what a clip is, how it is read, and how colour becomes grey."""

from eqs.frames.checks import checked_frames, checked_times
from eqs.frames.flow import FlowInterpolation
from eqs.frames.folder import FrameFolder, image_paths, read_image
from eqs.frames.interpolation import (
    CachedInterpolation,
    Interpolation,
    LinearInterpolation,
    NetworkInterpolation,
)
from eqs.frames.luma import GreyImage, luma
from eqs.frames.video import VideoFile

__all__ = [
    "CachedInterpolation",
    "FlowInterpolation",
    "FrameFolder",
    "GreyImage",
    "Interpolation",
    "LinearInterpolation",
    "NetworkInterpolation",
    "VideoFile",
    "checked_frames",
    "checked_times",
    "image_paths",
    "luma",
    "read_image",
]
