"""What a study writes beside its tables."""

import numpy as np
import pytest

from eqs.metrics import Judge
from eqs.pipelines.publish import anchor_table, hashes, mean_maps


def test_anchors_are_means_over_recordings_with_the_highest_headline_first():
    rows = [
        {"sequence": "a", "anchor": "blank", "hidden_raw": 0.0, "gate_raw": 0.9},
        {"sequence": "a", "anchor": "ceiling", "hidden_raw": 0.8, "gate_raw": 0.1},
        {"sequence": "b", "anchor": "blank", "hidden_raw": 0.2, "gate_raw": 0.7},
        {"sequence": "b", "anchor": "ceiling", "hidden_raw": 1.0, "gate_raw": 0.3},
    ]
    table = anchor_table(rows, "eqs_hidden_raw")
    assert table["anchor"].tolist() == ["ceiling", "blank"]
    assert table["eqs_hidden_raw"].tolist() == pytest.approx([0.9, 0.1])
    assert anchor_table(rows, "eqs_gate_raw")["anchor"].tolist() == ["blank", "ceiling"]


def test_maps_are_averaged_over_recordings_of_the_first_one_s_sensor():
    small, other = np.zeros((2, 3)), np.ones((2, 3))
    means = mean_maps({"esim": [small, other, np.full((4, 4), 9.0)]})
    np.testing.assert_array_equal(means["esim"], np.full((2, 3), 0.5))


def test_what_a_score_hangs_on_is_named_by_its_hashes(make_events):
    raw = Judge.random(size="tiny")
    plain = hashes(raw, raw.reading(), None)
    assert plain == {
        "EQS definition": raw.definition.hash,
        "judge's weights (sha256)": raw.weights_sha256,
    }
    centred = raw.centred_on([make_events(3000, 32, 32)])
    named = hashes(centred, centred.reading(), "51f1")
    assert named["judge's centre (sha256)"] == centred.centres[0].sha256
    assert named["reference sensor"] == "51f1"
    assert named["EQS definition"] != plain["EQS definition"]
