"""Sequences as DSEC distributes them, made small: rectified frames, calibration, events, labels."""

import shutil

import numpy as np
import yaml
from PIL import Image

FRAME_SIZE = (54, 72)


def calibration(size=(24, 32), frame_size=FRAME_SIZE):
    """A `cam_to_cam.yaml` of a frame camera that is twice as fine and looks a little aside."""
    focal = float(size[1])
    turn = 0.01
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    pose[0, 3] = -0.045
    return {
        "intrinsics": {
            "cam0": {
                "camera_matrix": [focal, focal, size[1] / 2, size[0] / 2],
                "distortion_coeffs": [-0.09, 0.19, -0.0004, 0.0002],
                "resolution": [size[1], size[0]],
            },
            "camRect1": {
                "camera_matrix": [2 * focal, 2 * focal, frame_size[1] / 2, frame_size[0] / 2],
                "resolution": [frame_size[1], frame_size[0]],
            },
        },
        "extrinsics": {"T_10": pose.tolist(), "R_rect1": np.eye(3).tolist()},
    }


def bare(folder, frame_size=FRAME_SIZE, size=(24, 32)):
    """Turn a sequence with frames in the event view into one with rectified frames alone."""
    images = folder / "images/left"
    frames = sorted((images / "distorted").iterdir())
    (images / "rectified").mkdir()
    for index, path in enumerate(frames):
        coarse = np.random.default_rng(index).integers(0, 256, (9, 12, 3)).astype(np.uint8)
        picture = Image.fromarray(coarse).resize(frame_size[::-1], Image.Resampling.BICUBIC)
        picture.save(images / "rectified" / path.name)
    shutil.rmtree(images / "distorted")
    (folder / "calibration").mkdir()
    (folder / "calibration/cam_to_cam.yaml").write_text(
        yaml.safe_dump(calibration(size, frame_size))
    )
    return folder


def a_folder_per_archive(tree, root):
    """`train/SEQUENCE/...` as `train_events/SEQUENCE/events/...` and so on."""
    archives = {"events": "events", "images": "images", "calibration": "calibration"}
    archives["object_detections"] = "object_detections"
    for sequence in sorted(tree.glob("*/*")):
        split = sequence.parent.name
        for part, archive in archives.items():
            if (sequence / part).exists():
                target = root / f"{split}_{archive}" / sequence.name / part
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copytree(sequence / part, target)
    return root


def single_downloads(tree, root):
    """`train/SEQUENCE/...` as `SEQUENCE_events_left/events.h5` and so on."""
    places = {
        "events/left": "events_left",
        "images/left/rectified": "images_rectified_left",
        "images/left/distorted": "images_distorted_left",
        "calibration": "calibration",
        "object_detections/left": "object_detections_left",
        "images/timestamps.txt": "image_timestamps.txt",
        "images/left/exposure_timestamps.txt": "image_exposure_timestamps_left.txt",
    }
    root.mkdir(parents=True)
    for sequence in sorted(tree.glob("*/*")):
        for place, name in places.items():
            source, target = sequence / place, root / f"{sequence.name}_{name}"
            if source.is_dir():
                shutil.copytree(source, target)
            elif source.is_file():
                shutil.copy(source, target)
    return root


def sequence_folders(tree, root):
    """Single downloads, sorted into a folder for each sequence."""
    single_downloads(tree, root)
    for sequence in sorted(tree.glob("*/*")):
        folder = root / "DSEC" / sequence.name
        folder.mkdir(parents=True)
        for path in sorted(root.glob(f"{sequence.name}_*")):
            kept = path.name if path.suffix else path.name.removeprefix(f"{sequence.name}_")
            path.rename(folder / kept)
    return root


def one_tree(tree, root):
    """As it is."""
    shutil.copytree(tree, root)
    return root


LAYOUTS = (one_tree, a_folder_per_archive, single_downloads, sequence_folders)
