"""Frames: what a clip is, how it is read, and how colour becomes grey."""

from eqs.frames.checks import WHITE, checked_frames, checked_times
from eqs.frames.flow import FlowInterpolation
from eqs.frames.folder import FrameFolder, image_paths
from eqs.frames.image import IMAGE_SUFFIXES, image_size, read_image, require_opaque
from eqs.frames.interpolation import (
    CachedInterpolation,
    Interpolation,
    LinearInterpolation,
    NetworkInterpolation,
)
from eqs.frames.lens import Lens
from eqs.frames.light import Light, LightOfScenes, LightSource, linear_to_srgb
from eqs.frames.luma import GreyImage, luma
from eqs.frames.order import by_name
from eqs.frames.photocurrent import QUANTUM_EFFICIENCY, flat_response, photocurrent
from eqs.frames.remapping import View, remapped
from eqs.frames.video import VideoFile

__all__ = [
    "IMAGE_SUFFIXES",
    "QUANTUM_EFFICIENCY",
    "WHITE",
    "CachedInterpolation",
    "FlowInterpolation",
    "FrameFolder",
    "GreyImage",
    "Interpolation",
    "Lens",
    "Light",
    "LightOfScenes",
    "LightSource",
    "LinearInterpolation",
    "NetworkInterpolation",
    "VideoFile",
    "View",
    "by_name",
    "checked_frames",
    "checked_times",
    "flat_response",
    "image_paths",
    "image_size",
    "linear_to_srgb",
    "luma",
    "photocurrent",
    "read_image",
    "remapped",
    "require_opaque",
]
