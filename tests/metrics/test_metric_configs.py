"""The metric's configuration files build what they say."""

from pathlib import Path

import numpy as np
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from eqs.metrics import Centre, Definition

CONFIGS = Path(__file__).parents[2] / "eqs/configs"


def build(name, *overrides):
    with initialize_config_dir(str(CONFIGS), version_base=None):
        cfg = compose(overrides=[f"+metric={name}", *overrides])
    return instantiate(cfg.metric, weights="random", size="tiny")


def test_paper_reading():
    metric = build("eqs_paper")
    assert metric.definition == Definition(tap="gate", architecture="rvt-tiny-split2")


def test_headline_reading(tmp_path):
    means = tuple(np.ones(width, np.float32) for width in (32, 64, 128))
    Centre(tap="hidden", stages=(1, 2, 3), means=means).save(tmp_path / "centre.npz")
    metric = build("eqs", f"metric.centre={tmp_path / 'centre.npz'}", "metric.stages=[1,2]")
    assert metric.definition == Definition(
        features="centred", stages=(1, 2), architecture="rvt-tiny-split2"
    )
