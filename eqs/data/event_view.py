"""Rectified frames of DSEC, remapped into the view of the event camera and kept."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
import yaml
from PIL import Image
from rich.progress import track
from scipy import sparse

from eqs.content import content_hash, content_hashes
from eqs.data.places import CALIBRATION, Places
from eqs.data.recording import frames_in
from eqs.files import complete_file, one_at_a_time, read_json, short_hash, write_json
from eqs.frames import View, read_image, remapped
from eqs.processors import available_cores, side_by_side

log = logging.getLogger(__name__)
VERSION = 1  # raised whenever equal frames begin to be remapped otherwise
BATCH = 16  # frames that a process is given at once
PACKING = 1  # of PNG files: fast, a tenth larger than the best


@dataclass(frozen=True, kw_only=True)
class EventView:
    """Remaps frames and knows those that are.

    Frames that are remapped are kept one by one, so that a cut run goes on; a sequence counts as
    done while its rectified frames and its calibration are what they were.

    Args:
        root: folder for the remapped frames.
        samples: points along each side of a pixel that are averaged.
        workers: processes that remap side by side.
    """

    root: Path | str
    samples: int = 4
    workers: int = field(default_factory=available_cores)

    def places(self, places: Places) -> Places:
        """The places of a sequence with its remapped frames, if these are complete."""
        record = self._record(places)
        if not record.is_file() or read_json(record).get("made_of") != self._sources(places):
            return places
        return replace(places, frames=self._folder(places))

    def prepare(self, sequences: Sequence[Places]) -> None:
        """Remap what is missing; sequences that came with such frames are left alone.

        Raises:
            ValueError: a calibration is missing or does not fit, or an image cannot be read.
        """
        bare = [each for each in sequences if not frames_in(each.frames)]
        bare = [each for each in bare if frames_in(each.rectified)]
        if not bare:
            return
        with one_at_a_time(Path(self.root), "remapping frames"):
            missing = [each for each in bare if self.places(each) is each]
            for places in missing:
                view_of(places.calibration)  # what is refused, before the work
            jobs = [batch for places in missing for batch in self._batches(places)]
            done = side_by_side(partial(remap, samples=self.samples), jobs, self.workers)
            for _ in track(done, description="remapping frames", total=len(jobs)):
                pass
            for places in missing:
                write_json(self._record(places), {"made_of": self._sources(places)})

    def _folder(self, places: Places) -> Path:
        return Path(self.root) / places.name / "images" / "left" / "distorted"

    def _record(self, places: Places) -> Path:
        return Path(self.root) / places.name / "made_of.json"

    def _sources(self, places: Places) -> str:
        """What remapped frames are made of, by content."""
        rectified = frames_in(places.rectified)
        if not rectified or not places.calibration.is_file():
            return ""
        names = [path.stem for path in rectified]
        calibration = content_hash(places.calibration)
        return short_hash([VERSION, self.samples, calibration, names, content_hashes(rectified)])

    def _batches(self, places: Places) -> list[Batch]:
        """The frames that are not there yet; those of other sources are removed first."""
        folder, begun = self._folder(places), self._record(places).with_name("begun.json")
        sources = {"made_of": self._sources(places)}
        if not begun.is_file() or read_json(begun) != sources:
            for path in frames_in(folder):
                path.unlink()
            write_json(begun, sources)
        pairs = [(path, folder / f"{path.stem}.png") for path in frames_in(places.rectified)]
        pairs = [pair for pair in pairs if not pair[1].exists()]
        return [
            Batch(calibration=places.calibration, pairs=pairs[first : first + BATCH])
            for first in range(0, len(pairs), BATCH)
        ]


@dataclass(frozen=True, kw_only=True)
class Batch:
    """Images of one calibration, each with the file that it is remapped into."""

    calibration: Path
    pairs: Sequence[tuple[Path, Path]]


def remap(batch: Batch, samples: int) -> int:
    """Remap a batch of images; returns their number.

    Raises:
        ValueError: one of them is no image, or not of the calibration's size.
    """
    view, weights = _weights(batch.calibration, samples)
    for source, target in batch.pairs:
        image = read_image(source)
        if image.shape[:2] != view.frame_size or image.dtype != np.uint8:
            raise ValueError(
                f"Expected 8 bits and {view.frame_size[1]}x{view.frame_size[0]} pixels, as "
                f"{batch.calibration} says, got {image.dtype} and {image.shape[1]}x"
                f"{image.shape[0]} in {source}; replace it"
            )
        with complete_file(target) as partial_file, partial_file.open("wb") as file:
            made = Image.fromarray(remapped(weights, image, view.size))
            made.save(file, format="PNG", compress_level=PACKING)
    return len(batch.pairs)


@lru_cache(maxsize=1)
def _weights(calibration: Path, samples: int) -> tuple[View, sparse.csr_matrix]:
    view = view_of(calibration)
    return view, view.weights(samples)


def view_of(calibration: Path) -> View:
    """How the left event camera looks into the rectified images of the left frame camera.

    Convention: of DSEC's four cameras 0 is the left event camera and 1 the left frame camera.

    Args:
        calibration: a `cam_to_cam.yaml`.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it lacks something.
    """
    if not calibration.is_file():
        raise FileNotFoundError(
            f"Expected a calibration at {calibration}, found none; unpack DSEC's calibration "
            f"({CALIBRATION}), or the distorted images of DSEC-Detection"
        )
    try:
        content = yaml.safe_load(calibration.read_text())
        cameras, poses = content["intrinsics"], content["extrinsics"]
        event, frame = cameras["cam0"], cameras["camRect1"]
        turned = np.array(poses["R_rect1"], float) @ np.array(poses["T_10"], float)[:3, :3]
        return View(
            matrix=np.array(event["camera_matrix"], float).reshape(4),
            distortion=np.array(event["distortion_coeffs"], float).reshape(4),
            size=(int(event["resolution"][1]), int(event["resolution"][0])),
            rotation=turned.reshape(3, 3),
            frame_matrix=np.array(frame["camera_matrix"], float).reshape(4),
            frame_size=(int(frame["resolution"][1]), int(frame["resolution"][0])),
        )
    except (yaml.YAMLError, KeyError, TypeError, ValueError, IndexError) as error:
        raise ValueError(
            f"Expected the calibration of DSEC (intrinsics and extrinsics of cam0 and cam1) in "
            f"{calibration}, got one without: {error}; unpack it again"
        ) from error
