"""The page on data of one's own: its YAML and its class are trained on and checked as it says."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "own_data.md").read_text()
SMALL = [
    "recipe=dsec_mini_smoke", "recipe.epochs=1", "recipe.validate_every_epochs=1",
    "recipe.steps_per_epoch=1", "model=rvt_tiny", "trainer=cpu", "recipe.sequence_length=2",
]  # fmt: skip


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def frames(folder: Path, count: int = 5) -> None:
    folder.mkdir(parents=True)
    for index in range(count):
        picture = np.random.default_rng(index).integers(0, 256, (48, 64)).astype(np.uint8)
        Image.fromarray(picture).save(folder / f"{index:04d}.png")


def labelled(folder: Path, events) -> None:
    """A recording as the page's YAML describes it."""
    frames(folder / "frames")
    np.savez(folder / "events.npz", t=events.t, x=events.x, y=events.y, p=events.p)
    (folder / "timestamps.txt").write_text("".join(f"{50_000 * k}\n" for k in range(5)))
    images = [{"id": k, "file_name": f"{k:04d}.png"} for k in range(5)]
    boxes = [
        {"image_id": k, "bbox": [4, 5, 30, 20], "category_id": 1 + 6 * (k % 2)} for k in range(5)
    ]
    (folder / "labels.json").write_text(json.dumps({"images": images, "annotations": boxes}))


def evt2(path: Path, events) -> None:
    """A RAW file: a word of time, then one event of that time, again and again."""
    high = (8 << 28) | (events.t >> 6)
    low = (events.p.astype(np.int64) << 28) | ((events.t & 63) << 22)
    low |= (events.x.astype(np.int64) << 11) | events.y
    header = b"% evt 2.0\n% geometry 64x48\n% end\n"
    path.write_bytes(header + np.stack([high, low], axis=1).astype("<u4").tobytes())


def typed(place: Path, verb: str, *arguments: str) -> str:
    command = [sys.executable, "-m", "eqs", verb, "--config-dir", "my", *arguments]
    paths = os.pathsep.join([str(place), str(ROOT)])
    environment = {**os.environ, "PYTHONPATH": paths, "COLUMNS": "300", "HYDRA_FULL_ERROR": "0"}
    done = subprocess.run(
        command, cwd=place, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_the_data_set_in_a_yaml_is_checked_and_trained_on(tmp_path, make_events):
    assert blocks("yaml")[0].count("\n") <= 40
    (tmp_path / "my/data").mkdir(parents=True)
    (tmp_path / "my/data/mine.yaml").write_text(blocks("yaml")[0])
    for name in ("day_1", "dusk_1", "night_1"):
        labelled(tmp_path / "recordings" / name, make_events(900, 48, 64, 0, 200_001))
    said = typed(tmp_path, "check", "data=mine", "protocol=own")
    assert "all 3 recordings can be used" in said
    trained = typed(tmp_path, "train", "data=mine", "protocol=own", "sim=esim", *SMALL)
    assert re.search(r"esim-\w+ seed 0: own test mAP", trained)
    (result,) = tmp_path.glob("runs/mine/*/*/result.json")
    classes = json.loads(result.read_text())["protocol"]["classes"]
    assert classes == {"car": [1], "person": [2, 7]}


@pytest.mark.slow
def test_the_data_set_in_a_class_is_trained_on(tmp_path, make_events):
    (source,) = blocks("python")
    assert source.count("\n") <= 40
    (tmp_path / "my_camera.py").write_text(source)
    (tmp_path / "my/data").mkdir(parents=True)
    (tmp_path / "my/data/my_camera.yaml").write_text(blocks("yaml")[1])
    for split in ("train", "val", "test"):
        folder = tmp_path / "recordings" / split / f"{split}_1"
        frames(folder / "frames")
        evt2(folder / "events.raw", make_events(900, 48, 64, 0, 200_001))
        (folder / "boxes.csv").write_text("".join(f"{50_000 * k},4,5,30,20,2\n" for k in range(5)))
    said = typed(
        tmp_path, "train", "data=my_camera", "protocol.classes={car: [2]}", "sim=real", *SMALL
    )
    assert "real seed 0: own test mAP" in said
