"""ROS 1 and ROS 2 bags and MCAP files: their topics, and the bytes of their messages.

Source: the serialisation rules of ROS 1 and of CDR.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Self

from eqs.events.bounded import BoundedPath
from eqs.extras import needed

ROS1 = b"#ROSBAG"
BAGS = (ROS1, b"SQLite format 3", b"\x89MCAP")  # what they begin with
METADATA = "metadata.yaml"  # what a folder has that is a bag of ROS 2


def is_bag_folder(path: Path) -> bool:
    """Whether a folder is a bag of ROS 2."""
    return (path / METADATA).is_file()


def is_bag(path: Path) -> bool:
    """Whether a file or a folder is a bag.

    Raises:
        FileNotFoundError: there is none.
    """
    if path.is_dir():
        return is_bag_folder(path)
    with path.open("rb") as file:
        return file.read(len(max(BAGS, key=len))).startswith(BAGS)


class Message:
    """Reads one message's bytes field by field.

    Args:
        raw: the bytes.
        ros1: whether fields follow each other without gaps, as in ROS 1; CDR aligns them.
    """

    def __init__(self, raw: bytes, *, ros1: bool) -> None:
        """Begin at the first field."""
        self.raw, self.ros1 = raw, ros1
        self.start = self.at = 0 if ros1 else 4
        self.stamp_us = 0

    def number(self, size: int) -> int:
        """The next whole number of so many bytes.

        Raises:
            ValueError: the message ends before.
        """
        if not self.ros1:
            self.at = self.start + -(-(self.at - self.start) // size) * size
        value = self.raw[self.at : self.at + size]
        if len(value) < size:
            raise ValueError("Expected whole messages, got one that was cut off; record it again")
        self.at += size
        return int.from_bytes(value, "little")

    def text(self) -> str:
        """The next text."""
        return self.bytes().rstrip(b"\0").decode("latin-1")

    def bytes(self) -> bytes:
        """The next row of bytes."""
        count = self.number(4)
        self.at += count
        return bytes(self.raw[self.at - count : self.at])

    def header(self) -> None:
        """The stamp, which is kept, and the name of the frame of reference."""
        if self.ros1:
            self.number(4)
        self.stamp_us = 1_000_000 * self.number(4) + self.number(4) // 1000
        self.text()

    def sized_header(self) -> tuple[int, int]:
        """Height and width, which follow the header."""
        self.header()
        return self.number(4), self.number(4)


class Bag:
    """A bag, open in the block: its topics, and the bytes of their messages.

    Args:
        path: the file, or the folder of a bag of ROS 2.

    Raises:
        ValueError: the bag is damaged, or rosbags, the optional dependency `ros`, is not installed.
    """

    def __init__(self, path: Path) -> None:
        """Find out of which version it is."""
        self.path = path
        self.ros1 = False
        if not path.is_dir():
            with path.open("rb") as file:
                self.ros1 = file.read(len(ROS1)) == ROS1

    def __enter__(self) -> Self:
        """Open the bag."""
        with needed("ros", f"to read {self.path}"):
            from rosbags.rosbag1 import Reader as Reader1
            from rosbags.rosbag2 import Reader as Reader2
        with self._whole():
            self._reader = (Reader1 if self.ros1 else Reader2)(BoundedPath(self.path))
            self._reader.open()
        return self

    def __exit__(self, *_: object) -> None:
        """Close the bag."""
        self._reader.close()

    @property
    def kinds(self) -> dict[str, str]:
        """The kind of message of each topic."""
        return {each.topic: each.msgtype for each in self._reader.connections}

    def listed(self) -> str:
        """All topics and their kinds."""
        return ", ".join(f"{topic} ({kind})" for topic, kind in self.kinds.items()) or "none"

    def topics(self, kinds: Collection[str], named: Sequence[str] = ()) -> list[str]:
        """The topics of these kinds of messages, those that are named where any is.

        Raises:
            ValueError: the bag lacks a topic that is named.
        """
        for topic in named:
            if topic not in self.kinds:
                raise ValueError(
                    f"Expected the topic {topic} in {self.path}, got {self.listed()}; name one of "
                    "these with --topic"
                )
        return [
            topic
            for topic, kind in self.kinds.items()
            if kind in kinds and (not named or topic in named)
        ]

    def messages(self, topic: str) -> Iterator[bytes]:
        """The bytes of a topic's messages, whoever published them."""
        of_topic = [each for each in self._reader.connections if each.topic == topic]
        with self._whole():
            found = self._reader.messages(connections=of_topic)
        while True:
            with self._whole():
                message = next(found, None)
            if message is None:
                return
            yield bytes(message[2])

    @contextmanager
    def _whole(self) -> Iterator[None]:
        try:
            yield
        except Exception as error:  # the library raises whatever damage leads it to
            raise ValueError(f"Expected a whole bag at {self.path}, got: {error}") from error


def one_topic(bag: Bag, kinds: Sequence[str], what: str, named: Sequence[str]) -> str | None:
    """The topic of these kinds of messages; none where the bag has none.

    Raises:
        ValueError: there are several, or the bag lacks a topic that is named.
    """
    found = bag.topics(kinds, named)
    if len(found) > 1:
        raise ValueError(
            f"Expected one topic of {what} ({', '.join(kinds)}) in {bag.path}, got "
            f"{bag.listed()}; name the one that is meant with --topic"
        )
    return found[0] if found else None


def kinds_of(path: Path, topics: Sequence[str]) -> list[str]:
    """The kinds of messages of these topics of a bag.

    Raises:
        ValueError: the bag lacks one of them, or is damaged.
    """
    with Bag(path) as bag:
        bag.topics((), topics)
        return [bag.kinds[topic] for topic in topics]
