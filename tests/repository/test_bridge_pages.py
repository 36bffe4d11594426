"""The pages on engines: what is typed here runs on what an engine would have left."""

import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from ros_bags import event_array, image, write

from eqs.events import Events
from eqs.events.carla import PACKED
from eqs.simulators import CARLA, Gazebo

ROOT = Path(__file__).parents[2]
PAGES = {name: (ROOT / f"docs/from_{name}.md").read_text() for name in ("carla", "ros", "blender")}
HEIGHT, WIDTH, COUNT = 48, 64, 5


def blocks(name: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGES[name], re.DOTALL)


def typed(place: Path, name: str, replaced: dict[str, str]) -> list[str]:
    """What the commands of a page say, on a smaller sensor than the page's."""
    said = []
    (block,) = blocks(name, "sh")
    for line in block.splitlines():
        for old, new in replaced.items():
            line = line.replace(old, new)
        command = line.split()
        assert command[0] == "eqs"
        done = subprocess.run(
            [sys.executable, "-m", *command], cwd=place, capture_output=True, text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
        said.append(done.stdout + done.stderr)
    return said


def levels() -> np.ndarray:
    """A bright edge that moves to the right, as shares of white."""
    columns = np.arange(WIDTH)
    rows = [np.where(columns < 20 + 5 * k, 0.8, 0.2) for k in range(COUNT)]
    return np.repeat(np.array(rows)[:, None], HEIGHT, axis=1)


def bytes_of(shares: np.ndarray) -> np.ndarray:
    return np.repeat((shares * 255).astype(np.uint8)[..., None], 3, axis=-1)


def checked(path: Path, start_us: int, stop_us: int) -> Events:
    """Events of the edge, between the first frame and the last."""
    events = Events.load(path)
    assert (events.height, events.width) == (HEIGHT, WIDTH)
    assert len(events) > 0
    assert start_us <= events.t[0]
    assert events.t[-1] <= stop_us
    return events


@pytest.mark.parametrize("name", ["carla", "blender"])
def test_the_scripts_for_the_engines_are_python_and_short(name):
    (source,) = blocks(name, "python")
    compile(source, f"{name}.py", "exec")
    assert source.count("\n") <= 45
    assert max(map(len, source.splitlines())) <= 120


def test_the_sensor_for_gazebo_is_xml_with_what_the_text_says():
    (source,) = blocks("ros", "xml")
    sensor = ET.fromstring(source)
    assert sensor.find("plugin/eventThreshold").text == "10"
    assert sensor.find("camera/image/format").text == "R8G8B8"
    assert sensor.find("camera/noise") is None


@pytest.mark.parametrize(("name", "model"), [("carla", CARLA), ("ros", Gazebo)])
def test_the_tables_of_names_name_parameters_that_exist(name, model):
    table = PAGES[name].partition("## Names")[2].partition("\n##")[0]
    ours = [re.search(r"`(\w+)`", row.split("|")[2]) for row in table.splitlines() if "| `" in row]
    known = {field.name for field in fields(model)}
    named = {found[1] for found in ours if found}
    assert named
    assert named <= known


@pytest.mark.slow
def test_frames_and_events_of_carla(tmp_path):
    drive = tmp_path / "drive"
    (drive / "rgb").mkdir(parents=True)
    (drive / "dvs").mkdir()
    numbers = [17, 18, 20, 21, 22]  # a frame was lost
    lines = [f"{number} {number * 0.002:.9f}\n" for number in range(17, 23)]
    (drive / "timestamps_s.txt").write_text("".join(lines))
    for number, picture in zip(numbers, bytes_of(levels()), strict=True):
        Image.fromarray(picture).save(drive / f"rgb/{number}.png")
        table = np.zeros(10, PACKED)
        table["t"] = number * 2_000_000 + np.arange(10)
        table["x"] = np.arange(10)
        (drive / f"dvs/{number}.raw").write_bytes(table.tobytes())
    said = typed(tmp_path, "carla", {"480": str(HEIGHT), "640": str(WIDTH)})
    for name in ("ours.h5", "v2e.h5"):
        checked(tmp_path / name, 34_000, 44_000)
    found = checked(tmp_path / "carla.h5", 34_000, 44_000)
    assert found.t.tolist() == [2000 * number for number in numbers for _ in range(10)]
    assert "50 events of events of CARLA, times in ns" in said[2]
    assert f"sensor      {WIDTH} x {HEIGHT}" in said[3]


@pytest.mark.slow
def test_frames_and_events_of_bags(tmp_path):
    def messages(store):
        for index, picture in enumerate(bytes_of(levels())):
            time_us = 1_000_000 + 20_000 * index
            yield "/camera/image_raw", time_us, image(store, picture, "rgb8", time_us)
            part = Events.from_arrays(
                t=time_us + np.arange(20), x=np.arange(20), y=np.arange(20), p=np.ones(20, int),
                height=HEIGHT, width=WIDTH,
            )  # fmt: skip
            yield "/dvs/events", time_us + 1, event_array(store, part, time_us)

    write(tmp_path, "bag", messages)
    write(tmp_path, "mcap", messages).rename(tmp_path / "run")
    said = typed(tmp_path, "ros", {})
    checked(tmp_path / "ours.h5", 1_000_000, 1_080_000)
    found = checked(tmp_path / "gazebo.h5", 1_000_000, 1_080_000)
    assert set(found.t.tolist()) == {1_000_000 + 20_000 * k for k in range(COUNT)}
    assert found.p.sum() == 0
    for recording, line in (("first", 3), ("second", 5)):
        assert "100 events of a bag of event arrays, 5 frames" in said[line]
        events = tmp_path / "recordings" / recording / "events/left/events.h5"
        assert checked(events, 1_000_000, 1_080_019).p.all()


@pytest.mark.slow
def test_frames_of_blender_and_of_others(tmp_path):
    openexr = pytest.importorskip("OpenEXR")
    folders = {name: tmp_path / name for name in
               ("renders", "arrays", "unreal", "numbered", "seconds")}  # fmt: skip
    for folder in folders.values():
        folder.mkdir()
    kind = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    for index, shares in enumerate(levels()):
        light = np.repeat(4 * shares[..., None], 3, axis=2).astype(np.float32)
        with openexr.File(kind, {"RGB": light}) as file:
            file.write(str(folders["renders"] / f"{index + 1:06d}.exr"))
        np.save(folders["arrays"] / f"{index}.npy", shares.astype(np.float32))
        deep = Image.fromarray((shares * 65535).astype(np.uint16))
        for name, number in (("unreal", index), ("numbered", 100 + index + index // 3)):
            deep.save(folders[name] / f"{number:06d}.png")
        deep.save(folders["seconds"] / f"{index}.png")
    lines = [f"{k + 1} {k / 500:.9f}\n" for k in range(COUNT + 3)]
    (folders["renders"] / "timestamps_s.txt").write_text("".join(lines))
    lines = [f"{1_700_000_000_000_000_000 + 20_000_000 * k}\n" for k in range(COUNT)]
    (folders["unreal"] / "timestamps_ns.txt").write_text("".join(lines))
    (folders["seconds"] / "timestamps.txt").write_text("0.5\n0.6\n0.7\n0.8\n0.9\n")
    typed(tmp_path, "blender", {})
    epoch = 1_700_000_000_000_000
    for name, start_us, stop_us in (
        ("blender", 0, 8000), ("arrays", 0, 8000), ("unreal", epoch, epoch + 80_000),
        ("numbered", 0, 83_333), ("seconds", 500_000, 900_000),
    ):  # fmt: skip
        checked(tmp_path / f"{name}.h5", start_us, stop_us)
    assert Events.load(tmp_path / "numbered.h5").t[-1] > 66_666  # five frames and a gap
