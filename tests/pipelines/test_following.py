"""How far a scoring is: a bar on a terminal, lines in a log, nothing outside."""

import io
import logging

import pytest
import torch
from rich.console import Console

from eqs.metrics.definition import Definition
from eqs.pipelines.following import Following, all_of

DEFINITION = Definition()


def seen(windows):
    """What a watcher sees of so many windows."""
    return {DEFINITION.maps: [torch.zeros(windows, 2, 3, 4, 5)]}


class Clock:
    """Seconds that pass when told to."""

    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def quiet_console(**given):
    return Console(file=io.StringIO(), width=120, **given)


def test_a_log_gets_a_line_every_so_often(caplog, clock):
    caplog.set_level(logging.INFO)
    following = Following(3, console=quiet_console(), every_s=30, clock=clock)
    with following as follow:
        follow.recording("a")
        follow.recording("b")
        watch = follow.a_pass("anchors", DEFINITION, 0, 120 * 50_000)
        for _ in range(10):
            clock.now += 6
            watch(seen(5))
    # The warm-up of 20 windows is not seen, and half of the others are after 60 s.
    assert caplog.messages == [
        "b (2 of 3) anchors: 25 of 100 windows, 1.5 min left",
        "b (2 of 3) anchors: 50 of 100 windows, 1.0 min left",
    ]


def test_time_between_lines_passes_from_recording_to_recording(caplog, clock):
    caplog.set_level(logging.INFO)
    following = Following(2, console=quiet_console(), every_s=30, clock=clock)
    for name in "ab":
        following.recording(name)
        with following as follow:
            watch = follow.a_pass("scoring", DEFINITION, 0, 60 * 50_000)
            clock.now += 20
            watch(seen(45))
    assert caplog.messages == ["b (2 of 2) scoring: 45 of 45 windows, 0.0 min left"]


def test_a_terminal_gets_a_bar_and_no_lines(caplog, clock):
    caplog.set_level(logging.INFO)
    console = quiet_console(force_terminal=True)
    with Following(console=console, every_s=0, clock=clock) as follow:
        follow.a_pass("scoring", DEFINITION, 0, 60 * 50_000)(seen(9))
        follow.bar.refresh()
        follow.a_pass("anchors", DEFINITION, 0, 60 * 50_000)(seen(8))
        assert len(follow.bar.tasks) == 1
        follow.bar.refresh()
    shown = console.file.getvalue()
    assert "scoring" in shown
    assert "9/45" in shown
    assert "8/45" in shown
    assert caplog.messages == []


def test_outside_it_is_silent(caplog, clock):
    caplog.set_level(logging.INFO)
    console = quiet_console()
    follow = Following(console=console, every_s=0, clock=clock)
    follow.a_pass("scoring", DEFINITION, 0, 60 * 50_000)(seen(9))
    assert caplog.messages == []
    assert console.file.getvalue() == ""


def test_several_watchers_see_the_same():
    found = []
    all_of(found.append, lambda pooled: found.append(len(pooled)))({"a": 1, "b": 2})
    assert found == [{"a": 1, "b": 2}, 2]
