"""The page: whole in itself, sound as HTML, and alive in a browser where there is one."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from eqs.events import Events
from eqs.pair import PageWindows, diagnose, write_page
from eqs.pair.page import event_uri, map_uri, shown_windows

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
VOID = {"meta", "img", "input", "link", "br"}


def events(seed: int) -> Events:
    rng = np.random.default_rng(seed)
    return Events.from_arrays(
        t=np.sort(rng.integers(0, 200_000, 900)), x=rng.integers(0, 24, 900),
        y=rng.integers(0, 16, 900), p=rng.integers(0, 2, 900), height=16, width=24,
    )  # fmt: skip


@pytest.fixture
def page(tmp_path: Path) -> Path:
    simulated, real = events(1), events(2)
    parts = [(k * 50_000, (k + 1) * 50_000) for k in range(4)]
    path = tmp_path / "score.html"
    write_page(
        path,
        title="mine </script> & <b>theirs</b>",
        lines=["a < b"],
        curve=np.array([0.2, np.nan, 0.7, 0.9]),
        warmup=1,
        window_us=50_000,
        levels={"chance": 0.1, "ceiling": 0.95, "blank": float("nan")},
        windows=PageWindows(
            numbers=[0, 1, 2, 3],
            simulated=[event_uri(simulated.window(*part)) for part in parts],
            real=[event_uri(real.window(*part)) for part in parts],
            maps=[np.array([[0.1, np.nan], [0.5, 1.0]])] * 4,
        ),
        diagnosis=diagnose(simulated, real, start_us=0, stop_us=200_000),
        nearest=[("50% of the events missing", 0.71)],
        size=(16, 24),
    )
    return path


class Checked(HTMLParser):
    """Sees that every element is closed, and what it refers to."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.links += [str(value) for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag


def test_the_page_needs_nothing_else(page: Path) -> None:
    text = page.read_text()
    checked = Checked()
    checked.feed(text)
    assert checked.open in ([], ["html"])
    assert checked.links == []
    assert not re.search(r"https?://(?!www\.w3\.org)", text)
    assert "<b>theirs" not in text
    assert "a &lt; b" in text
    assert "fires" in text


def test_its_data_are_those_that_were_given(page: Path) -> None:
    (found,) = re.findall(r"const data = (.*);\n", page.read_text())
    data = json.loads(found)
    assert data["curve"] == [0.2, None, 0.7, 0.9]
    assert data["levels"] == {"chance": 0.1, "ceiling": 0.95}
    assert len(data["maps"]) == len(data["real"]) == len(data["simulated"]) == 4
    assert all(each.startswith("data:image/png;base64,") for each in data["maps"] + data["real"])


def test_pictures_are_small_and_maps_tell_agreement(page: Path) -> None:
    assert len(event_uri(events(1))) < 1500
    same, apart = map_uri(np.ones((4, 4))), map_uri(np.zeros((4, 4)))
    assert same != apart != map_uri(np.full((4, 4), np.nan))


def test_long_recordings_show_some_of_their_windows() -> None:
    shown = shown_windows(5_000, 96, 128)
    assert len(shown) == 200
    assert (shown[0], shown[-1]) == (0, 4_999)
    assert len(shown_windows(5_000, 720, 1280)) == 21


def test_it_works_in_a_browser(page: Path) -> None:
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip("no Chromium or Chrome to open the page in")
    done = subprocess.run(
        [browser, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", page.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    assert "window 1, 0.00 s: 0.200" in done.stdout
    assert done.stdout.count('class="level"') == 2
    assert re.search(r'id="real"[^>]*src="data:image/png', done.stdout)
