"""The verbs that read any event file: info and convert."""

import numpy as np
import pytest

from eqs.commands.convert import main as convert
from eqs.commands.info import main as info
from eqs.events import Events


@pytest.fixture
def events(make_events):
    """Three seconds of events."""
    return make_events(5000, 24, 32, start_us=2_000_000, stop_us=5_000_000)


@pytest.fixture
def text(events, tmp_path):
    """The events as text, two of them late."""
    lines = [
        f"{t / 1e6:.6f} {x} {y} {p}\n"
        for t, x, y, p in zip(events.t, events.x, events.y, events.p, strict=True)
    ]
    lines[10], lines[12] = lines[12], lines[10]
    path = tmp_path / "events.txt"
    path.write_text("".join(lines))
    return path


def test_a_file_is_described(events, text, capsys):
    info([str(text), "--height", "24", "--width", "32", "--order", "txyp"], "eqs info")
    said = capsys.readouterr().out
    gap = int(np.diff(events.t).max())
    for line in (
        "format      a text file, times in s", "sensor      32 x 24", "events      5,000",
        f"first       {events.t[0]} us", f"last        {events.t[-1]} us",
        f"brighter    {100 * events.p.mean():.1f} %", f"longest gap {gap} us",
        "disorder    2 events came after a later one",
    ):  # fmt: skip
        assert f"{line}\n" in said
    assert len(said.splitlines()) == 11 + 24 - 4


def test_a_file_is_converted_in_order_and_never_over_another(events, text, tmp_path, capsys):
    out = tmp_path / "out" / "events.h5"
    arguments = [str(text), str(out), "--height", "24", "--width", "32", "--order", "txyp"]
    convert(arguments, "eqs convert")
    said = f"{out}: 5,000 events of a text file, times in s, 2 of them put in order\n"
    assert capsys.readouterr().out == said
    found = Events.load(out)
    for name in "txyp":
        np.testing.assert_array_equal(np.sort(getattr(found, name)), np.sort(getattr(events, name)))
    np.testing.assert_array_equal(found.t, events.t)
    with pytest.raises(SystemExit, match=r"Expected no file at .*, got one; name another place"):
        convert(arguments, "eqs convert")


def test_a_converted_file_of_dsec_keeps_its_span(make_events, tmp_path):
    events = make_events(100, 24, 32, start_us=10_000, stop_us=90_000)
    watched = Events(
        events.t, events.x, events.y, events.p, height=24, width=32, span_us=(0, 100_000)
    )
    watched.save(tmp_path / "a.h5")
    convert([str(tmp_path / "a.h5"), str(tmp_path / "b.h5")], "eqs convert")
    assert Events.load(tmp_path / "b.h5").span_us == (0, 100_000)


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["gone.raw"], "Expected an event file at gone.raw"),
        (["TEXT", "--order", "txyp"], "Expected the sensor's height, which a text file"),
        (["TEXT", "--order", "txxp"], "Expected an order of t, x, y and p, got 'txxp'"),
    ],
)
def test_what_cannot_be_described_ends_in_a_sentence(text, arguments, wanted):
    with pytest.raises(SystemExit) as stop:
        info([str(text) if each == "TEXT" else each for each in arguments], "eqs info")
    assert wanted in str(stop.value)
