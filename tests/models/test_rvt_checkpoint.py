"""Loading weights: published and own files, other class counts, broken files."""

import pickle

import pytest
import torch
from torch import nn

from eqs.models import RVTDetector, backbone_from_checkpoint
from eqs.models.checkpoint import check_resumable


@pytest.fixture(scope="module")
def detector():
    torch.manual_seed(3)
    return RVTDetector("tiny", num_classes=2, in_channels=6)


def save(path, detector, prefix="mdl.", **changes):
    entries = {prefix + name: x for name, x in detector.state_dict().items()}
    entries |= {prefix + name: x for name, x in changes.items()}
    torch.save({"epoch": 1, "state_dict": entries}, path)
    return path


def same(first, second):
    pairs = zip(first.state_dict().items(), second.state_dict().items(), strict=True)
    return all(a == b and torch.equal(x, y) for (a, x), (b, y) in pairs)


@pytest.mark.parametrize("prefix", ["mdl.", "model.", ""])
def test_size_channels_and_classes_come_from_the_file(tmp_path, detector, prefix):
    path = save(tmp_path / "a.ckpt", detector, prefix)
    loaded = RVTDetector.from_checkpoint(path)
    assert same(loaded, detector)
    assert (loaded.size, loaded.num_classes, loaded.backbone.in_channels) == ("tiny", 2, 6)


def test_plain_state_dicts_and_foreign_modules(tmp_path, detector):
    torch.save(detector.state_dict(), tmp_path / "plain.pt")
    assert same(RVTDetector.from_checkpoint(tmp_path / "plain.pt"), detector)
    entries = {f"model.{name}": x for name, x in detector.state_dict().items()}
    torch.save({"state_dict": {**entries, "metric.count": torch.ones(1)}}, tmp_path / "own.ckpt")
    assert same(RVTDetector.from_checkpoint(tmp_path / "own.ckpt"), detector)


def test_constructor_loads_weights(tmp_path, detector):
    path = save(tmp_path / "a.ckpt", detector)
    assert same(RVTDetector("tiny", num_classes=2, in_channels=6, weights=path), detector)


def test_another_class_count_needs_saying_so(tmp_path, detector):
    path = save(tmp_path / "a.ckpt", detector)
    with pytest.raises(ValueError, match=r"for 3 classes, got 2 .*set model.new_class_branch=true"):
        RVTDetector.from_checkpoint(path, num_classes=3)
    other = RVTDetector.from_checkpoint(path, num_classes=3, new_class_branch=True)
    assert other.yolox_head.cls_preds[0].weight.shape[0] == 3
    assert other.yolox_head.cls_preds[0].bias.unique().item() == pytest.approx(-4.59512)
    ours, theirs = other.state_dict(), detector.state_dict()
    changed = [name for name in ours if not torch.equal(ours[name], theirs[name])]
    assert changed
    assert all(name.startswith("yolox_head.cls_preds.") for name in changed)


def test_missing_unexpected_and_misshapen_entries_are_listed(tmp_path, detector):
    entries = {f"mdl.{name}": x for name, x in detector.state_dict().items()}
    del entries["mdl.fpn.bu_conv1.conv.weight"]
    entries["mdl.fpn.extra"] = torch.zeros(1)
    entries["mdl.yolox_head.obj_preds.0.bias"] = torch.zeros(2)
    torch.save({"state_dict": entries}, tmp_path / "odd.ckpt")
    wanted = (
        r"missing: fpn.bu_conv1.conv.weight; unexpected: fpn.extra; differently shaped: "
        r"yolox_head.obj_preds.0.bias \(2,\) instead of \(1,\)"
    )
    with pytest.raises(ValueError, match=wanted):
        RVTDetector.from_checkpoint(tmp_path / "odd.ckpt")


def test_another_size_is_refused(tmp_path, detector):
    path = save(tmp_path / "a.ckpt", detector)
    with pytest.raises(ValueError, match=r"Expected the 376 entries .*set\s+model.size"):
        RVTDetector("small", num_classes=2, in_channels=6, weights=path)


def test_files_that_are_no_checkpoints(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"Expected a checkpoint at .*set model.weights"):
        RVTDetector.from_checkpoint(tmp_path / "none.ckpt")
    (tmp_path / "text.ckpt").write_text("not a checkpoint")
    with pytest.raises(ValueError, match="weights_only=True refuses"):
        RVTDetector.from_checkpoint(tmp_path / "text.ckpt")
    torch.save({"state_dict": nn.Linear(1, 1).state_dict()}, tmp_path / "other.ckpt")
    with pytest.raises(ValueError, match=r"Expected one RVT detector in .*got 0"):
        RVTDetector.from_checkpoint(tmp_path / "other.ckpt")


@pytest.fixture
def training(tmp_path, detector):
    def saved(*without, **changes):
        entries = {f"model.{name}": x for name, x in detector.state_dict().items()}
        content = {"state_dict": entries | changes, "optimizer_states": [], "lr_schedulers": []}
        content["pytorch-lightning_version"] = "2.6.0"
        path = tmp_path / "last.ckpt"
        torch.save({key: x for key, x in content.items() if key not in without}, path)
        return path

    return saved


def test_only_a_training_of_the_same_detector_resumes(training, detector):
    check_resumable(detector, training())
    with pytest.raises(
        ValueError, match=r"8 classes to resume, got 2 in .*last.ckpt; set ckpt_path"
    ):
        check_resumable(RVTDetector("tiny", num_classes=8, in_channels=6), training())
    with pytest.raises(ValueError, match=r"Expected the 376 entries .*set\s+model.size"):
        check_resumable(RVTDetector("small", num_classes=2, in_channels=6), training())
    with pytest.raises(ValueError, match=r"without optimizer_states; set model.weights instead"):
        check_resumable(detector, training("optimizer_states"))


def test_what_cannot_be_resumed_names_its_key(tmp_path, training, detector):
    with pytest.raises(FileNotFoundError, match=r"nowhere.ckpt, got no such file; set ckpt_path"):
        check_resumable(detector, tmp_path / "nowhere.ckpt")
    path = training()
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(ValueError, match=r"refuses; set ckpt_path to another file"):
        check_resumable(detector, path)


class Payload:
    def __reduce__(self):
        return (exec, ("raise SystemExit('executed')",))


def test_pickled_code_is_not_run(tmp_path):
    with (tmp_path / "evil.ckpt").open("wb") as file:
        pickle.dump({"state_dict": Payload()}, file, protocol=2)
    with pytest.raises(ValueError, match="refuses"):
        RVTDetector.from_checkpoint(tmp_path / "evil.ckpt")


def test_a_checkpoint_that_knows_its_partition_is_taken_at_its_word(tmp_path):
    model = RVTDetector("tiny", num_classes=2, partition_split_32=1)
    path = tmp_path / "own.ckpt"
    torch.save({"state_dict": model.state_dict(), "partition_split_32": 1}, path)
    assert RVTDetector.from_checkpoint(path).backbone.partition_split_32 == 1
    assert backbone_from_checkpoint(path, 1)[0].partition_split_32 == 1
    for build in (RVTDetector.from_checkpoint, backbone_from_checkpoint):
        with pytest.raises(ValueError, match=r"Expected partition_split_32=1, .*got 2; leave"):
            build(path, partition_split_32=2)


def test_without_a_word_the_partition_is_the_published_one(tmp_path):
    path = tmp_path / "published.ckpt"
    torch.save({"state_dict": RVTDetector("tiny", num_classes=2).state_dict()}, path)
    assert RVTDetector.from_checkpoint(path).backbone.partition_split_32 == 2
    assert backbone_from_checkpoint(path, 1)[0].partition_split_32 == 1
