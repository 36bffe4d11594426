"""What was found with several sensors, joined."""

import io

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from eqs.study import eqs_table, print_sensors, sensors_table, study_table, write_table

SCORES = {"gen4-a1": {"esim": (0.5, 0.7), "v2e": (0.2, 0.4)}, "own-b2": {"esim": (0.1, 0.3)}}


def write(root, judge="j"):
    """Tables of two sensors, of which the second has no accuracies, and an empty folder."""
    for sensor, systems in SCORES.items():
        rows = [
            {"simulator": name, "sequence": str(index), "eqs": score, "definition": "d",
             "weights_sha256": judge if sensor == "gen4-a1" else "j"}
            for name, scores in systems.items() for index, score in enumerate(scores)
        ]  # fmt: skip
        write_table(eqs_table(rows), root / sensor / "eqs.csv")
    maps = {"map_sim": 0.4, "map50_sim": 0.6, "map50_real": 0.5}
    rows = [
        {"simulator": "esim", "seed": 0, "map_real": 0.2, **maps},
        {"simulator": "esim", "seed": 1, "map_real": 0.3, **maps},
        {"simulator": "real", "seed": 0, "map_real": 0.4, **maps},
    ]
    write_table(study_table(rows), root / "gen4-a1" / "accuracy.csv")
    (root / "empty-c3").mkdir()
    return {name: root / name for name in ("empty-c3", *SCORES)}


def printed(table):
    out = io.StringIO()
    print_sensors(table, Console(file=out, width=120))
    return out.getvalue()


def test_each_system_has_a_row_per_sensor_with_its_means(tmp_path):
    table = sensors_table(write(tmp_path)).set_index(["system", "sensor"])
    assert set(table.index) == {
        ("esim", "gen4-a1"), ("v2e", "gen4-a1"), ("real", "gen4-a1"), ("esim", "own-b2")
    }  # fmt: skip
    first = table.loc["esim", "gen4-a1"]
    assert (first["eqs"], first["map_real"], first["seeds"]) == pytest.approx((0.6, 0.25, 2))
    assert table.loc["esim", "own-b2"]["eqs"] == pytest.approx(0.2)
    assert np.isnan(table.loc["esim", "own-b2"]["map_real"])
    assert np.isnan(table.loc["real", "gen4-a1"]["eqs"])


def test_sensors_stand_side_by_side_by_name(tmp_path):
    said = printed(sensors_table(write(tmp_path)))
    assert "gen4 " in said
    assert "a1" not in said
    assert "0.600" in said
    assert "25.0" in said
    assert "several judges" not in said


def test_scores_of_several_judges_are_named(tmp_path):
    assert "several judges" in printed(sensors_table(write(tmp_path, judge="another")))


def test_the_newer_accuracies_count(tmp_path):
    folders = write(tmp_path)
    folder = folders["gen4-a1"]
    older = pd.read_csv(folder / "accuracy.csv")
    older["map_real"] = 0.9
    write_table(older, folder / "study.csv")
    (folder / "accuracy.csv").touch()
    table = sensors_table(folders).set_index(["system", "sensor"])
    assert table.loc["esim", "gen4-a1"]["map_real"] == pytest.approx(0.25)


def test_nothing_gives_an_empty_table(tmp_path):
    table = sensors_table({"gen4-a1": tmp_path})
    assert table.empty
    assert printed(table) == ""
