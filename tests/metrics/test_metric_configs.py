"""The metric's configuration files build what they say and offer every choice there is."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from eqs.metrics import Definition, Judge
from eqs.metrics.definition import VERSION_1, choices, kinds

CONFIGS = Path(__file__).parents[2] / "eqs/configs"
HEADLINE = Definition()
PAPER = {"features": "raw", "distance": "cosine", "patch_size": 3}


def build(name, *overrides, judge="random"):
    with initialize_config_dir(str(CONFIGS), version_base=None):
        cfg = compose(overrides=[f"+metric={name}", *overrides])
    return instantiate(cfg.eqs, judge=judge)


def test_the_paper_s_reading_is_the_raw_gate():
    metric = build("eqs_paper")
    assert metric.definition == Definition(tap="gate", **PAPER, architecture="rvt-small-split2")


def test_without_choices_the_judge_decides(make_events, tmp_path):
    recordings = [make_events(seed, height=32, width=32) for seed in (1, 2)]
    judge = Judge.random(size="tiny").centred_on(recordings)
    judge.save(tmp_path)
    metric = build("eqs", judge=str(tmp_path))
    assert metric.definition == Definition(architecture="rvt-tiny-split2")
    chosen = build("eqs", "eqs.stages=[1,2]", "eqs.features=raw", judge=str(tmp_path))
    assert chosen.definition == Definition(
        stages=(1, 2), features="raw", architecture="rvt-tiny-split2"
    )


def test_version_1_is_the_centred_cosine(make_events, tmp_path):
    recordings = [make_events(seed, height=32, width=32) for seed in (1, 2)]
    judge = Judge.random(size="tiny").centred_on(recordings)
    judge.save(tmp_path)
    metric = build("eqs_1", judge=str(tmp_path))
    assert metric.definition == replace(Definition(architecture="rvt-tiny-split2"), **VERSION_1)


@pytest.mark.parametrize("name", choices())
def test_every_choice_stands_in_the_file_with_its_headline_and_its_values(name):
    text = (CONFIGS / "metric" / "eqs.yaml").read_text()
    assert yaml.safe_load(text)[name] is None
    (line,) = (line for line in text.splitlines() if line.startswith(f"{name}:"))
    shown = getattr(HEADLINE, name)
    assert f"[{', '.join(map(str, shown)) if isinstance(shown, tuple) else shown}]" in line
    for value in kinds().get(name, ()):
        assert value in line
