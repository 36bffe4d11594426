"""Files for libraries that believe a damaged file how long its parts are."""

from __future__ import annotations

import io
from pathlib import Path, PosixPath
from typing import Any


class BoundedFile(io.BufferedReader):
    """A file that takes no memory for bytes that it does not have, however many are asked for."""

    def __init__(self, path: Path) -> None:
        """Open the file."""
        super().__init__(io.FileIO(path))
        self.length = path.stat().st_size

    def read(self, size: int | None = -1) -> bytes:
        """The next bytes, all that are left where more are asked for."""
        left = max(0, self.length - self.tell())
        return super().read(left if size is None or size < 0 else min(size, left))


class BoundedPath(PosixPath):
    """The path of a file that is opened as a bounded one."""

    def open(self, *_: object, **__: object) -> Any:  # noqa: ANN401
        """Open the file for reading."""
        return BoundedFile(self)
