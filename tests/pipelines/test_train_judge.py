"""A judge is trained, kept as scores need it, and goes on from where it stopped."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from hydra import compose, initialize_config_dir

from eqs.metrics import Judge
from eqs.pipelines import train_judge as pipeline
from eqs.pipelines.resolvers import register_resolvers
from eqs.training.judge_task import JudgeTask

CONFIGS = Path(__file__).parents[2] / "eqs/configs"
SMALL = (
    "lessons.count=3", "lessons.held_out=1", "lessons.windows=4",
    "recipe.epochs=2", "recipe.steps_per_epoch=2", "recipe.windows=3", "recipe.labelled=1",
    "recipe.canvases=[[32,32,2]]", "model=rvt_tiny", "trainer=cpu", "trainer.precision=32-true",
)  # fmt: skip


def run(place: Path, out: str, *overrides: str) -> Path:
    register_resolvers()
    paths = [f"paths.datasets={place / 'data'}", f"paths.runs={place / out / 'runs'}"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("train-judge", [*SMALL, *paths, f"out={place / out}", *overrides])
    cfg.lessons.sizes = {"32x32": 1.0}
    pipeline.train_judge(cfg)
    return place / out


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*num_workers.*", "ignore:.*LeafSpec.*:FutureWarning")
def test_it_leaves_a_judge_and_goes_on_to_equal_digits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run(tmp_path, "whole")
    judge = Judge.load(whole)
    assert len(judge.backbone.stages) == 3
    assert judge.reading().name == "hidden_silence"
    kept = torch.load(whole / "weights.ckpt", weights_only=True)
    assert {x.dtype for x in kept.values() if isinstance(x, torch.Tensor)} == {torch.float16}
    log = json.loads((whole / "training.json").read_text())
    assert len(log["epochs"]) == 2
    assert log["device"] == "processor"

    plain = JudgeTask.training_step

    def stopped(self: JudgeTask, step: torch.Tensor, batch_idx: int) -> torch.Tensor:
        if int(step) == 3:  # within the second epoch
            raise RuntimeError("power cut")
        return plain(self, step, batch_idx)

    monkeypatch.setattr(JudgeTask, "training_step", stopped)
    with pytest.raises(RuntimeError, match="power cut"):
        run(tmp_path, "parts")
    monkeypatch.undo()
    parts = run(tmp_path, "parts")
    assert Judge.load(parts).weights_sha256 == judge.weights_sha256
    assert json.loads((parts / "training.json").read_text())["epochs"] == log["epochs"]
