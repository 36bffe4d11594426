"""A wheel of this repository works where nothing else of it is."""

import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    # A copy without the build folder that setuptools would leave in the repository.
    source = folder / "source"
    source.mkdir()
    for name in ("eqs", "pyproject.toml", "README.md", "LICENSE", "MANIFEST.in"):
        (source / name).symlink_to(ROOT / name)
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation",
         "--wheel-dir", str(folder), str(source)],
        check=True,
    )  # fmt: skip
    (found,) = folder.glob("*.whl")
    return found


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """Runs a program of a new environment, with this one's libraries and the wheel's package."""
    place = tmp_path_factory.mktemp("environment")
    venv.create(place, with_pip=False, symlinks=True)
    site = place / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
    # Finders of an editable installation are not followed from here, so only libraries are lent.
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*install, "--target", str(site), str(wheel)], check=True)
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def run(folder, *arguments):
        return subprocess.run(
            [place / "bin" / "python", *arguments],
            cwd=folder,
            env=clean,
            capture_output=True,
            text=True,
            check=False,
        )

    run.site = site
    return run


def test_the_wheel_holds_the_package_with_its_configurations_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert wheel.name.startswith("event_quality_score-")
    assert {name.partition("/")[0].partition("-")[0] for name in names} == {
        "eqs",
        "event_quality_score",
    }
    packed = {name for name in names if name.startswith("eqs/configs/")}
    there = {path.relative_to(ROOT).as_posix() for path in (ROOT / "eqs/configs").rglob("*.yaml")}
    assert packed == there
    assert {"eqs/py.typed", "eqs/study/templates/report.html.j2"} <= set(names)
    metadata = next(name for name in names if name.endswith("entry_points.txt"))
    assert "eqs = eqs.commands:main" in zipfile.ZipFile(wheel).read(metadata).decode()


@pytest.mark.slow
def test_commands_work_outside_the_repository(installed, tmp_path):
    where = installed(tmp_path, "-c", "import eqs; print(eqs.__file__)")
    assert where.stdout.startswith(str(installed.site))
    assert "sim=esim" in installed(tmp_path, "-m", "eqs", "train", "--help").stdout
    composed = installed(tmp_path, "-m", "eqs", "train", "sim=v2e/paper", "--cfg", "job")
    assert "threshold_on_log: 0.3" in composed.stdout
    (tmp_path / "frames").mkdir()
    scene = np.random.default_rng(0).integers(0, 255, (32, 48)).astype(np.uint8)
    for index in range(12):
        Image.fromarray(np.roll(scene, index, 1)).save(tmp_path / f"frames/{index:02d}.png")
    for simulator in ("esim", "v2e/noisy"):
        out = simulator.replace("/", "-") + ".h5"
        clip = ["frames=frames", "frames_per_second=20", f"out={out}"]
        done = installed(tmp_path, "-m", "eqs", "simulate", f"sim={simulator}", *clip)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / out).exists()
    pair = ["v2e-noisy.h5", "esim.h5", "eqs.judge=random", "taps=[]"]
    done = installed(tmp_path, "-m", "eqs", "score", *pair)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results/score/score.json").exists()
    assert (tmp_path / "outputs/simulate").is_dir()
