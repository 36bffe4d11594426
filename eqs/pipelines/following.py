"""How far a long scoring is: a bar on a terminal, a line now and then in a log."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Final, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from torch import Tensor

from eqs.metrics.definition import Definition, Maps
from eqs.metrics.scoring import Watcher

log = logging.getLogger(__name__)
EVERY_S: Final = 30.0


class Following:
    """Counts the windows of one pass of the judge after the other; a watcher of each pass.

    Outside of its `with` it is silent.

    Args:
        recordings: how many are scored; of several each is numbered.
        console: where a bar appears, if it is a terminal.
        every_s: seconds between the lines of a log.
        clock: seconds that pass.
    """

    def __init__(
        self,
        recordings: int = 1,
        *,
        console: Console | None = None,
        every_s: float = EVERY_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Start with no recording."""
        self.recordings, self.every_s, self.clock = recordings, every_s, clock
        self.console = Console() if console is None else console
        self.name, self.number, self.said = "", 0, ""
        self.done, self.total = 0, 0
        self.speaks = False
        self.bar: Progress | None = None
        self.began_s = self.spoke_s = clock()

    def __enter__(self) -> Self:
        """Begin to speak."""
        self.speaks = True
        if self.console.is_terminal:
            columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                       TimeRemainingColumn())  # fmt: skip
            self.bar = Progress(*columns, console=self.console, transient=True)
            self.bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the bar away."""
        if self.bar is not None:
            self.bar.stop()
        self.speaks, self.bar = False, None

    def recording(self, name: str) -> None:
        """Go on to the next recording."""
        self.name, self.number = name, self.number + 1

    def a_pass(self, what: str, definition: Definition, start_us: int, stop_us: int) -> Self:
        """Begin a pass of the judge over a stretch of time, of which the warm-up is not seen."""
        windows = (stop_us - start_us) // definition.window_us
        several = f" ({self.number} of {self.recordings})" if self.recordings > 1 else ""
        self.said = " ".join(part for part in (f"{self.name}{several}", what) if part)
        self.done, self.total = 0, windows - definition.warmup_of(windows)
        self.began_s = self.clock()
        if self.bar is not None:
            for task in self.bar.task_ids:
                self.bar.remove_task(task)
            self.bar.add_task(self.said, total=self.total)
        return self

    def __call__(self, pooled: Mapping[Maps, Sequence[Tensor]]) -> None:
        """Count the windows that a watcher sees."""
        self.done += len(next(iter(pooled.values()))[0])
        now = self.clock()
        if self.bar is not None:
            self.bar.update(self.bar.task_ids[-1], completed=self.done)
        elif self.speaks and now - self.spoke_s >= self.every_s:
            self.spoke_s = now
            log.info("%s", self.line(now - self.began_s))

    def line(self, seconds: float) -> str:
        """How far the pass is after so many seconds, and how long it still takes."""
        left_s = seconds * (self.total - self.done) / max(self.done, 1)
        return f"{self.said}: {self.done} of {self.total} windows, {left_s / 60:.1f} min left"


def all_of(*watchers: Watcher) -> Watcher:
    """One watcher in place of several."""

    def watch(pooled: Mapping[Maps, Sequence[Tensor]]) -> None:
        for each in watchers:
            each(pooled)

    return watch
