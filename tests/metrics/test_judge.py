"""A judge: its hash, its folder, what it refuses."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from eqs.metrics import EventQualityScore, Judge, weights_sha256
from eqs.metrics.definition import VERSION_1
from eqs.metrics.judge import place_of, shipped
from eqs.models import RVTDetector

TINY = {"size": "tiny", "partition_split_32": 1}


@pytest.fixture(scope="module")
def detector(tmp_path_factory):
    """The checkpoint of a whole detector, as a training leaves it."""
    torch.manual_seed(3)
    model = RVTDetector(num_classes=3, **TINY)
    path = tmp_path_factory.mktemp("run") / "weights.ckpt"
    torch.save({"state_dict": {f"model.{k}": v for k, v in model.state_dict().items()}}, path)
    return path


@pytest.fixture
def judge(detector, make_events):
    recordings = [make_events(seed, height=32, width=32) for seed in (1, 2)]
    return Judge.from_checkpoint(detector, 1).centred_on(recordings, ["hidden", "gate"])


def scores_of(judge, make_events, **chosen):
    metric = EventQualityScore(judge, **chosen)
    metric.update(*(make_events(seed, height=32, width=32) for seed in (5, 6)))
    return metric.last


def test_a_folder_gives_the_judge_back(judge, make_events, tmp_path):
    judge.save(tmp_path)
    loaded = Judge.load(tmp_path)
    assert loaded.definition == judge.definition
    assert loaded.definition.features == "silence"
    assert loaded.weights_sha256 == judge.weights_sha256 == weights_sha256(loaded.backbone)
    assert [each.sha256 for each in loaded.centres] == [each.sha256 for each in judge.centres]
    for tap in ("hidden", "gate"):
        chosen = {"tap": tap, **VERSION_1}
        before, after = (scores_of(each, make_events, **chosen) for each in (judge, tmp_path))
        np.testing.assert_array_equal(before.curve, after.curve)


def test_the_weights_of_a_run_are_kept_and_are_the_judge(judge, detector, make_events):
    before = detector.read_bytes()
    judge.save(detector.parent)
    assert detector.read_bytes() == before
    assert Judge.load(detector).definition == Judge.load(detector.parent).definition
    assert scores_of(detector, make_events).score == scores_of(judge, make_events).score


def test_a_centre_is_one_part_of_several(judge, make_events):
    raw = replace(judge, centres=())
    assert raw.reading().name == judge.reading().name == "hidden_silence"
    assert scores_of(raw, make_events).score == scores_of(judge, make_events).score
    centred = scores_of(judge, make_events, **VERSION_1)
    plain = scores_of(judge, make_events, **{**VERSION_1, "features": "raw"})
    assert plain.score > centred.score
    recordings = [make_events(seed, height=32, width=32) for seed in (1, 2)]
    again = raw.centred_on(recordings)
    assert again.centres[0].sha256 == judge.centres[0].sha256
    assert {each.tap for each in judge.centres} == {"hidden", "gate"}


def test_centres_of_other_pooling_stand_beside_the_first(judge, make_events, tmp_path):
    recordings = [make_events(1, height=32, width=32)]
    both = judge.centred_on(recordings, patch_size=2)
    assert both.definition == judge.definition
    both.save(tmp_path)
    loaded = Judge.load(tmp_path)
    assert len(loaded.centres) == 3
    chosen = {**VERSION_1, "patch_size": 2}
    assert loaded.reading(**chosen).centre.sha256 == both.reading(**chosen).centre.sha256
    with pytest.raises(ValueError, match="pooled and binned as chosen, for centred features"):
        judge.reading(**chosen)


def test_the_untrained_control_has_the_same_shape(judge):
    control = judge.untrained()
    assert control.network == judge.network
    assert control.weights_sha256 == Judge.random(**TINY).weights_sha256 != judge.weights_sha256
    assert control.definition == judge.definition


def test_a_shortened_judge_scores_as_the_whole_one(detector, make_events, tmp_path):
    whole = Judge.from_checkpoint(detector, 1)
    for parameter in whole.backbone.parameters():
        parameter.data = parameter.data.half().float()
    short = Judge.shortened(whole.backbone, "the first stages")
    assert len(short.backbone.stages) == 3
    short.save(tmp_path)
    assert (tmp_path / "weights.ckpt").stat().st_size < 0.2 * detector.stat().st_size
    loaded = Judge.load(tmp_path)
    assert loaded.weights_sha256 == short.weights_sha256
    scores = [scores_of(each, make_events).score for each in (whole, loaded)]
    assert scores[0] == pytest.approx(scores[1], abs=1e-6)


def test_the_package_brings_a_judge():
    (name,) = shipped()
    judge = Judge.load(name)
    assert len(judge.backbone.stages) == 3
    assert judge.reading().name == "hidden_silence"
    files = place_of(name).iterdir()
    assert sum(path.stat().st_size for path in files) < 6e6


def test_the_hash_sees_values_and_names():
    a, b = torch.nn.Linear(2, 2), torch.nn.Linear(2, 2)
    b.load_state_dict(a.state_dict())
    assert weights_sha256(a) == weights_sha256(b)
    with torch.no_grad():
        b.bias[0] += 1
    assert weights_sha256(a) != weights_sha256(b)
    assert weights_sha256(a) != weights_sha256(torch.nn.Sequential(a))


def test_foreign_and_missing_files_are_named(judge, tmp_path, backbone):
    judge.save(tmp_path / "judge")
    with pytest.raises(FileNotFoundError, match=r"judge\.json in .*; set eqs\.judge"):
        Judge.load(tmp_path)
    with pytest.raises(FileNotFoundError, match=r"gone, got no such file; set eqs\.judge"):
        Judge.load(tmp_path / "gone")
    with pytest.raises(ValueError, match=r"partition_split_32=1, as it was trained, got 2"):
        Judge.load(tmp_path / "judge", partition_split_32=2)
    Judge.random(seed=7, **TINY).save(tmp_path / "other")
    (tmp_path / "other" / "weights.ckpt").replace(tmp_path / "judge" / "weights.ckpt")
    with pytest.raises(ValueError, match=r"match their hashes, got others in weights\.ckpt"):
        Judge.load(tmp_path / "judge")
    record = json.loads((tmp_path / "judge" / "judge.json").read_text())
    del record["network"]
    (tmp_path / "judge" / "judge.json").write_text(json.dumps(record))
    with pytest.raises(ValueError, match=r"a judge\.json that lacks or adds 'network'"):
        Judge.load(tmp_path / "judge")
    with pytest.raises(ValueError, match="that can be built anew, got a SmallBackbone that is on"):
        Judge.of(backbone).save(tmp_path / "small")


def test_choices_are_checked(judge):
    with pytest.raises(ValueError, match=r"Expected choices among tap, .* got nose; set one"):
        judge.define(nose=1)
    with pytest.raises(ValueError, match=r"Expected a tap among gate, .*, got nose; set eqs\.tap"):
        judge.define(tap="nose")
    with pytest.raises(ValueError, match=r"got 'hex'; set eqs\.patch"):
        judge.define(patch="hex")
    assert judge.define(stages=[1, 2]).stages == (1, 2)
