"""Frames in ROS 1 and ROS 2 bags and MCAP files.

Source: the message definitions of `sensor_msgs`, and the names of its encodings.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from eqs.data.frame import Frame
from eqs.events.bag import Bag, Message, one_topic
from eqs.frames import require_opaque

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
IMAGES = (IMAGE, COMPRESSED)
# Bytes of a number, and which of a pixel's numbers are grey, or red, green and blue, and alpha.
ENCODINGS: dict[str, tuple[int, tuple[int, ...]]] = {
    "mono8": (1, (0,)), "8UC1": (1, (0,)), "mono16": (2, (0,)), "16UC1": (2, (0,)),
    "rgb8": (1, (0, 1, 2)), "bgr8": (1, (2, 1, 0)),
    "rgba8": (1, (0, 1, 2, 3)), "bgra8": (1, (2, 1, 0, 3)),
}  # fmt: skip


def bag_frames(path: Path, topics: Sequence[str] = ()) -> Iterator[Frame]:
    """The frames of the only topic with frames in a bag, or of the one that is named.

    Convention: a frame's time is its header's stamp, whole microseconds, rounded down.

    Raises:
        ValueError: there are several such topics, or the bag lacks one that is named, or frames are
            of an encoding that is not read, transparent or cut off, or the bag is damaged.
    """
    with Bag(path) as bag:
        topic = one_topic(bag, IMAGES, "frames", topics)
        if topic is None:
            return
        compressed = bag.kinds[topic] == COMPRESSED
        for raw in bag.messages(topic):
            message = Message(raw, ros1=bag.ros1)
            picture = _decompressed(message, path) if compressed else _picture(message, path)
            yield Frame(message.stamp_us, picture)


def _picture(message: Message, path: Path) -> NDArray[Any]:
    """The pixels of one message of `sensor_msgs/Image`, whose rows may be longer than they are."""
    height, width = message.sized_header()
    encoding = message.text()
    if encoding not in ENCODINGS:
        raise ValueError(
            f"Expected frames of {', '.join(ENCODINGS)} in {path}, got {encoding or 'none'}; "
            "convert them, for instance with image_proc"
        )
    size, order = ENCODINGS[encoding]
    kind = np.dtype(f">u{size}" if message.number(1) else f"<u{size}")
    step, content = message.number(4), message.bytes()
    used = width * len(order) * size
    if len(content) != height * step or step < used:
        raise ValueError(
            f"Expected frames of {width}x{height} pixels in {path}, got {len(content)} bytes in "
            f"rows of {step}; record it again"
        )
    rows = np.frombuffer(content, np.uint8).reshape(height, step)[:, :used]
    pixels = np.ascontiguousarray(rows).view(kind).reshape(height, width, len(order))
    return _opaque(pixels[..., order].astype(kind.newbyteorder("=")), path)


def _decompressed(message: Message, path: Path) -> NDArray[Any]:
    """The pixels of one message of `sensor_msgs/CompressedImage`, a JPEG or a PNG."""
    message.header()
    said = message.text()
    if "compressedDepth" in said:
        raise ValueError(
            f"Expected frames as JPEG or PNG in {path}, got {said}, which are distances; name the "
            "topic of a camera"
        )
    try:
        with Image.open(io.BytesIO(message.bytes())) as image:
            mode, pixels = image.mode, np.asarray(image)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise ValueError(
            f"Expected frames as JPEG or PNG in {path}, got {said or 'others'}: {error}"
        ) from error
    if mode not in ("L", "I;16", "RGB", "RGBA"):
        raise ValueError(
            f"Expected grey or colour frames of 8 bits or grey ones of 16 in {path}, got mode "
            f"{mode}; convert them"
        )
    return _opaque(pixels.reshape(*pixels.shape[:2], -1), path)


def _opaque(pixels: NDArray[Any], path: Path) -> NDArray[Any]:
    """Pixels `(H, W, C)` as a picture, grey `(H, W)` or RGB `(H, W, 3)`, without alpha."""
    if pixels.shape[2] == 4:
        require_opaque(pixels[..., 3] == np.iinfo(pixels.dtype).max, path)
    return pixels[..., 0] if pixels.shape[2] == 1 else pixels[..., :3]
