"""A full disk is said in a sentence with the file's name, and nothing half is left."""

import os
import subprocess
import sys

import pytest
from fault_harness import REPOSITORY
from omegaconf import OmegaConf

from eqs.pipelines.command import sentence

# A limit on the size of a file stands for a disk that fills up while it is written.
SOURCE = """
import resource, sys
from pathlib import Path
import h5py, numpy as np, torch
from eqs.files import complete_file, complete_folder
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
kind, path = sys.argv[1], Path(sys.argv[2])
complete = complete_folder if kind == "folder" else complete_file
try:
    with complete(path) as partial:
        if kind == "text":
            partial.write_text("a" * 1_000_000)
        elif kind == "folder":
            (partial / "frame.png").write_bytes(bytes(1_000_000))
        elif kind == "numpy":
            with partial.open("wb") as file:
                np.savez(file, numbers=np.arange(100_000))
        elif kind == "torch":
            torch.save({"weights": torch.rand(100_000)}, partial)
        else:
            with h5py.File(partial, "w") as file:
                file["events"] = np.arange(100_000)
except OSError as error:
    print("full", error.filename)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="sizes of files are limited on Unix")
@pytest.mark.parametrize("kind", ["text", "folder", "numpy", "torch", "hdf5"])
def test_what_does_not_fit_is_named_and_nothing_is_left(tmp_path, kind) -> None:
    path = tmp_path / "written"
    run = subprocess.run(
        [sys.executable, "-c", SOURCE, kind, str(path)],
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stdout.strip()) == (0, f"full {path}"), run.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_sentence_names_the_place() -> None:
    cfg = OmegaConf.create({"paths": {"runs": "/place/runs", "results": "/place/results"}})
    said = sentence(OSError(28, "No space left on device", "/place/runs/last.ckpt"), cfg)
    assert "/place/runs/last.ckpt" in said
    assert "full disk" in said
    assert said.endswith("set paths.runs")
