"""What a study writes beside its tables."""

from pathlib import Path

import numpy as np
import pytest

from eqs.data import Recording
from eqs.metrics import Judge
from eqs.metrics.definition import VERSION_1
from eqs.pipelines.publish import anchor_table, hashes, mean_maps, same_sensor
from eqs.pipelines.sensors import Sensor


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


def test_anchors_are_means_over_the_recordings_that_have_all_of_them():
    rows = [
        {"sequence": "a", "anchor": "ceiling", "hidden_raw": 0.8},
        {"sequence": "a", "anchor": "chance", "hidden_raw": 0.4},
        {"sequence": "b", "anchor": "ceiling", "hidden_raw": 0.2},
    ]
    table = anchor_table(rows, "eqs_hidden_raw").set_index("anchor")
    assert table["eqs_hidden_raw"].to_dict() == pytest.approx({"ceiling": 0.8, "chance": 0.4})
    assert table["sequences"].tolist() == [1, 1]


def test_maps_are_averaged_over_recordings_of_the_shown_one_s_sensor():
    sizes = [(6, 9), (4, 4), (4, 4), (6, 9)]
    recordings = [
        Recording(
            name=str(k),
            folder=Path(),
            height=h,
            width=w,
            frame_times_us=np.empty(0),
            events_path=Path(),
        )
        for k, (h, w) in enumerate(sizes)
    ]
    small = np.zeros((2, 2))
    maps = {"esim": [np.full((2, 3), 9.0), small, small + 1, np.full((2, 3), 9.0)]}
    alike = same_sensor(recordings, recordings[2])
    assert alike == [1, 2]
    np.testing.assert_array_equal(mean_maps(maps, alike)["esim"], small + 0.5)


def test_what_a_score_hangs_on_is_named_by_its_hashes(make_events):
    raw = Judge.random(size="tiny")
    plain = hashes(raw, raw.reading(), None)
    assert plain == {
        "EQS definition": raw.definition.hash,
        "judge's weights (sha256)": raw.weights_sha256,
    }
    centred = raw.centred_on([make_events(3000, 32, 32)])
    reading = centred.reading(**VERSION_1)
    named = hashes(centred, reading, Sensor("reference_sensor", "51f1"))
    assert named["judge's centre (sha256)"] == centred.centres[0].sha256
    assert named["reference sensor"] == "51f1"
    assert hashes(centred, reading, Sensor("gen4", "e7a7"))["sensor gen4"] == "e7a7"
    assert named["EQS definition"] != plain["EQS definition"]
