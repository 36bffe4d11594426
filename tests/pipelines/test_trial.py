"""A whole trial of two tiny recordings: its tables, and that nothing is done twice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hydra import compose, initialize_config_dir

from eqs.pipelines import trial as pipeline
from eqs.pipelines.resolvers import register_resolvers
from eqs.trial.challengers import HEADLINE

CONFIGS = Path(__file__).parents[2] / "eqs/configs"


def run(out: Path, *overrides: str) -> pd.DataFrame:
    register_resolvers()
    small = ["size=48x48", "windows=4", "workers=1", "judges=[random]", "controls=[]",
             "scenes=[passing]", f"out={out}"]  # fmt: skip
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("trial", [*small, *overrides])
    cfg.halves.development.sensors = ["reference_sensor"]
    cfg.halves.held_out.sensors = ["first_order"]
    cfg.simulators = {name: cfg.simulators[name] for name in ("esim", "carla", "v2e")}
    pipeline.trial(cfg)
    return pd.read_csv(out / "trial.csv")


@pytest.mark.slow
def test_a_trial_is_tabulated_and_typed_again_does_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = run(tmp_path).set_index(["half", "challenger"])
    for half in ("development", "held_out"):
        row = table.loc[half, HEADLINE]
        assert row["blank"] == pytest.approx(0.0, abs=1e-3)
        assert row["chance"] < row["ceiling"] < 1
        assert 0.5 < row["in_order"] <= 1
        assert 0 <= row["above_floor"] <= 1
        assert np.isnan(row["rank_agreement"])  # one recording agrees with no other
    assert np.isnan(table.loc["held_out", HEADLINE]["order: refractory"])  # has none
    simulators = pd.read_csv(tmp_path / "simulators.csv")
    assert {"esim", "carla", "v2e"} < set(simulators)
    text = (tmp_path / "trial.md").read_text()
    assert "## held_out, judge random" in text
    assert "strobe 20 Hz (>= 0.30)" in text

    def nothing(*_: object) -> None:
        raise AssertionError("scored again")

    monkeypatch.setattr(pipeline, "score", nothing)
    again = run(tmp_path).set_index(["half", "challenger"])
    pd.testing.assert_frame_equal(table, again)
    with pytest.raises(AssertionError, match="scored again"):
        run(tmp_path, "seed=1")
