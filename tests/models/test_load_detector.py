"""A trained detector in plain PyTorch: from its file alone, step by step, exported."""

from dataclasses import asdict

import pytest
import torch

from eqs.models import Geometry, RVTDetector, TrainedDetector, load_detector
from eqs.models.settings import built

SIZE = {"height": 40, "width": 60}
SAID = {**SIZE, "bins": 3, "window_us": 20_000, "count_cutoff": 7, "class_names": ("car", "van")}
SETTINGS = {"size": "tiny", "num_classes": 2, "in_channels": 6, "partition_split_32": 1}


@pytest.fixture(scope="module")
def model() -> RVTDetector:
    torch.manual_seed(3)
    return RVTDetector(**SETTINGS).eval()


@pytest.fixture
def saved(tmp_path, model):
    def save(**content):
        entries = {f"model.{name}": x for name, x in model.state_dict().items()}
        torch.save({"state_dict": entries, **content}, tmp_path / "weights.ckpt")
        return tmp_path / "weights.ckpt"

    return save


@pytest.fixture
def record():
    return {"model": {"_target_": "eqs.models.RVTDetector", **SETTINGS, "weights": None}, **SAID}


def windows(count: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(1)
    shape = (count, 1, 6, SIZE["height"], SIZE["width"])
    return torch.randint(0, 6, shape, generator=generator).float()


def test_everything_comes_from_the_file(saved, record, model):
    detector = load_detector(saved(detector=record))
    assert asdict(detector.geometry) == SAID
    assert not detector.training
    assert detector.model.backbone.partition_split_32 == 1
    states = expected_states = None
    with torch.no_grad():
        for window in windows(2):
            found, states = detector(window.byte(), states)
            expected, expected_states = model(window, expected_states)
            torch.testing.assert_close(found, expected, rtol=0, atol=0)


def test_zeros_are_the_states_of_a_stream_that_has_not_begun(saved, record):
    detector = load_detector(saved(detector=record))
    (window,) = windows(1)
    begun, without = detector(window, detector.start())[0], detector(window, None)[0]
    torch.testing.assert_close(begun, without, rtol=0, atol=1e-5)
    assert {len(each) for state in detector.start(streams=3) for each in state} == {3}


@pytest.mark.parametrize("prefix", ["mdl.", "model.", ""])
def test_what_older_files_do_not_say_is_named_and_given(tmp_path, model, prefix):
    path = tmp_path / "published.ckpt"
    entries = {prefix + name: x for name, x in model.state_dict().items()}
    torch.save({"state_dict": entries} if prefix else entries, path)
    wanted = (
        r"Expected height, width, window_us, count_cutoff, class_names, partition_split_32 in "
        r".*published.ckpt, .*; give load_detector height=\.\.\., .*partition_split_32=\.\.\.$"
    )
    with pytest.raises(ValueError, match=wanted):
        load_detector(path)
    given = {name: value for name, value in SAID.items() if name != "bins"}
    detector = load_detector(path, **given, partition_split_32=1)
    assert asdict(detector.geometry) == SAID
    (window,) = windows(1)
    with torch.no_grad():
        torch.testing.assert_close(detector(window)[0], model(window)[0], rtol=0, atol=0)


def test_our_files_of_before_know_their_partition(saved):
    path = saved(partition_split_32=1)
    given = {name: value for name, value in SAID.items() if name != "bins"}
    assert load_detector(path, **given).model.partition_split_32 == 1
    with pytest.raises(ValueError, match=r"got partition_split_32=2 instead of 1; leave partition"):
        load_detector(path, **given, partition_split_32=2)
    with pytest.raises(ValueError, match=r"Expected 2 class_names, .* got 3; set class_names"):
        load_detector(path, **{**given, "class_names": ("a", "b", "c")})


def test_what_the_file_says_cannot_be_said_otherwise(saved, record):
    path = saved(detector=record)
    with pytest.raises(ValueError, match=r"got height=480 instead of 40; leave height out"):
        load_detector(path, height=480)
    with pytest.raises(ValueError, match=r"got hieght=40; leave hieght out"):
        load_detector(path, hieght=40)


def test_foreign_settings_build_nothing_but_modules(saved, record, tmp_path):
    trap = tmp_path / "trap"
    for target, complaint in (
        ("pathlib.Path", "class of a torch module as pathlib.Path"),
        ("subprocess.run", "class of a torch module as subprocess.run"),
        ("gone.Detector", "class that can be imported as gone.Detector, got: No module"),
        ("torch.nn.Gone", "class that can be imported as torch.nn.Gone"),
        ("Detector", "class that can be imported as Detector"),
        ("torch.nn.Linear", "Expected settings that torch.nn.Linear takes"),
    ):
        record["model"] = {"_target_": target, "args": [str(trap)]}
        with pytest.raises(ValueError, match=complaint):
            load_detector(saved(detector=record))
    record["model"] = {"_target_": "torch.nn.Sequential"}
    with pytest.raises(ValueError, match=r"Expected the 0 entries .* unexpected: backbone"):
        load_detector(saved(detector=record))
    assert not trap.exists()


def test_settings_below_settings_are_built():
    inner = {"_target_": "torch.nn.Linear", "in_features": 2, "out_features": 3}
    outer = built({"_target_": "torch.nn.ModuleDict", "modules": {"a": inner, "b": inner}})
    assert [each.out_features for each in outer.values()] == [3, 3]


@pytest.mark.filterwarnings("ignore:.*LeafSpec.*:FutureWarning")
def test_the_exported_step_is_the_detector(saved, record, tmp_path):
    detector = load_detector(saved(detector=record))
    program = torch.export.export(detector, (windows(1)[0], detector.start()))
    torch.export.save(program, tmp_path / "detector.pt2")
    step = torch.export.load(tmp_path / "detector.pt2").module()
    eager = exported = detector.start()
    for window in windows(2):
        expected, eager = detector(window, eager)
        found, exported = step(window, exported)
        torch.testing.assert_close(found, expected, rtol=0, atol=1e-5)
        torch.testing.assert_close(exported, eager, rtol=0, atol=1e-5)
    assert any(each.abs().max() > 0 for state in exported for each in state)


def test_what_is_no_detector_is_refused():
    geometry = Geometry(**SAID)
    with pytest.raises(ValueError, match=r"got a Linear without forward_sequence, loss, detect"):
        TrainedDetector(torch.nn.Linear(1, 1), geometry)
