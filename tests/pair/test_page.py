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
from eqs.pair import Nearest, PageContent, PageWindows, diagnose, event_uri, map_uri, write_page

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
    shown = PageWindows(
        numbers=[0, 1, 2, 3],
        simulated=[event_uri(simulated.window(*part)) for part in parts],
        real=[event_uri(real.window(*part)) for part in parts],
        maps=[map_uri(np.array([[0.1 * k, np.nan], [0.5, 1.0]]), 12, 16, 24) for k in range(4)],
    )
    content = PageContent(
        title="mine </script> & <b>theirs</b>",
        lines=["a < b", "the mark <!--NEAREST--> of a file"],
        reading="hidden_silence",
        curve=np.array([0.2, np.nan, 0.7, 0.9]),
        warmup=1,
        start_us=2_000_000,
        window_us=50_000,
        levels={"ceiling": 0.95, "chance": 0.1, "blank": float("nan")},
        windows=shown,
        diagnosis=diagnose(simulated, real, start_us=0, stop_us=200_000),
        nearest=[Nearest("dropped", 0.5, 0.71, "50% of the events missing", 0.01)],
        size=(16, 24),
    )
    return write_page(tmp_path / "score.html", content)


class Checked(HTMLParser):
    """Sees that every element is closed, and what it refers to."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []
        self.unnamed = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.links += [str(value) for name, value in attrs if name in ("src", "href")]
        self.unnamed += tag == "img" and not dict(attrs).get("alt")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag


def test_the_page_needs_nothing_else(page: Path) -> None:
    text = page.read_text()
    checked = Checked()
    checked.feed(text)
    assert checked.open == []
    assert checked.links == []
    assert checked.unnamed == 0
    assert "http:" not in text
    assert "https:" not in text
    assert "default-src 'none'" in text  # and the browser sees to it
    assert "prefers-color-scheme: dark" in text
    assert "<b>theirs" not in text
    assert "a &lt; b" in text
    assert "the mark &lt;!--NEAREST--&gt; of a file" in text
    assert "It fires about as often as the real sensor." in text
    assert text.count("50% of the events missing") == 1
    assert not re.search(r"<!--[A-Z]+-->", text)


def test_its_data_are_those_that_were_given(page: Path) -> None:
    (found,) = re.findall(r"const data = (.*);\n", page.read_text())
    data = json.loads(found)
    assert data["curve"] == data["values"] == [0.2, None, 0.7, 0.9]
    assert data["levels"] == {"ceiling": 0.95, "chance": 0.1}
    assert len(data["maps"]) == len(data["real"]) == len(data["simulated"]) == 4
    assert all(each.startswith("data:image/png;base64,") for each in data["maps"] + data["real"])


# What a browser gives the page's script, as far as it asks for it.
STAND_IN = """
const nodes = {}, heard = {};
const node = id => nodes[id] ??= {
  id, style: {}, attributes: {}, clientWidth: 500, innerHTML: "",
  setAttribute(name, value) { this.attributes[name] = String(value); },
  addEventListener(name, does) { heard[`${id} ${name}`] = does; },
  getBoundingClientRect: () => ({left: 0, width: 500}),
};
const document = {
  getElementById: node, addEventListener: (name, does) => { heard[`document ${name}`] = does; },
};
const window = {addEventListener: (name, does) => { heard[`window ${name}`] = does; }};
let beat = null;
const setInterval = does => { beat = does; return 1; }, clearInterval = () => { beat = null; };
node("slider").value = 0;
"""
PLAYED = """
const key = (name, target) =>
  heard["document keydown"]({key: name, target, preventDefault() {}});
const now = () => ({
  at: Number(node("slider").value), said: node("said").value, real: node("real").src,
  map: node("map").src, alt: node("map").alt, mark: Number(node("mark").attributes.x1),
  button: node("play").textContent,
});
const found = [now()];
node("slider").value = 2; heard["slider input"](); found.push(now());
key("ArrowRight"); found.push(now());
key("ArrowRight"); found.push(now());
key("ArrowLeft"); found.push(now());
key("ArrowLeft", node("slider")); found.push(now());  // the slider moves by itself
key(" "); beat(); beat(); found.push(now());
heard["play click"](); found.push({...now(), beats: beat !== null});
heard["curve click"]({clientX: 60}); found.push(now());
console.log(JSON.stringify({found, curve: node("curve").innerHTML}));
"""


def test_its_script_answers_slider_keys_play_and_clicks(page: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node to run the page's script in")
    (script,) = re.findall(r"<script>(.*)</script>", page.read_text(), flags=re.DOTALL)
    done = subprocess.run(
        [node, "-"], input=STAND_IN + script + PLAYED, capture_output=True, text=True, check=True,
        timeout=60,
    )  # fmt: skip
    result = json.loads(done.stdout)
    found, curve = result["found"], result["curve"]
    assert [each["at"] for each in found] == [0, 2, 3, 3, 2, 2, 0, 0, 0]
    data = json.loads(re.findall(r"const data = (.*);\n", page.read_text())[0])
    assert all(each["real"] == data["real"][each["at"]] for each in found)
    assert all(each["map"] == data["maps"][each["at"]] for each in found)
    assert found[0]["said"] == "window 1 of 4, from 2.00 s: 0.200 (warm-up)"
    assert found[1]["said"] == "window 3 of 4, from 2.10 s: 0.700"
    assert "from 2.10 s: 0.700 on the whole" in found[1]["alt"]
    assert found[0]["mark"] < found[1]["mark"] < found[2]["mark"]
    assert (found[6]["button"], found[7]["button"], found[7]["beats"]) == ("pause", "play", False)
    assert curve.count('class="level"') == 2
    assert "ceiling 0.950" in curve
    assert "NaN" not in curve


def test_it_works_in_a_browser(page: Path) -> None:
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip("no Chromium or Chrome to open the page in")
    done = subprocess.run(
        [browser, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", page.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    assert "window 1 of 4, from 2.00 s: 0.200" in done.stdout
    assert done.stdout.count('class="level"') == 2
    assert re.search(r'id="real"[^>]*src="data:image/png', done.stdout)
