"""The study on DSEC: equal numbers from every layout, and the paper's own study by name."""

from pathlib import Path

import pandas as pd
import pytest
from dsec_sequences import a_folder_per_archive, bare, one_tree, single_downloads
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from omegaconf import DictConfig, open_dict

from eqs.pipelines.evaluate import evaluate
from eqs.pipelines.prepare import prepare
from eqs.pipelines.recipe import recipe_hash
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.train import train

CONFIGS = Path(__file__).parents[2] / "eqs/configs"
SEQUENCES = {
    "train": ["interlaken_00_c", "zurich_city_01_e", "zurich_city_16_a"],
    "test": ["thun_01_a", "zurich_city_14_b"],
}


def composed(name: str, *overrides: str) -> DictConfig:
    register_resolvers()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose(name, overrides=list(overrides))


def small(place: Path, root: Path, name: str, *overrides: str) -> DictConfig:
    paths = [f"paths.{key}={place / key}" for key in ("datasets", "simulated", "runs", "results")]
    cfg = composed(
        name, "experiment=paper", f"data.root={root}", "data.size=64x48", "data.crop_rows=null",
        "data.first_frames=5", "model=rvt_tiny", "recipe.epochs=1", "recipe.steps_per_epoch=1",
        "recipe.validate_every_epochs=1", "recipe.batch_size=2", "recipe.sequence_length=2",
        "trainer=cpu", *paths, *overrides,
    )  # fmt: skip
    with open_dict(cfg):
        cfg.callbacks = {}
    return cfg


@pytest.mark.slow
def test_every_layout_trains_and_scores_to_equal_numbers(tmp_path, make_recording):
    for split, names in SEQUENCES.items():
        for seed, name in enumerate(names):
            folder = make_recording(
                tmp_path / "tree" / split / name, frames=7, height=48, width=64, seed=seed
            )
            bare(folder, frame_size=(108, 144), size=(48, 64))
    found = []
    for layout in (one_tree, a_folder_per_archive, single_downloads):
        place = tmp_path / layout.__name__
        root = layout(tmp_path / "tree", place / "dsec")
        prepare(small(place, root, "prepare"))
        for simulator in ("real", "v2e/paper"):
            train(small(place, root, "train", f"sim={simulator}"))
        evaluate(small(place, root, "evaluate", "score=true"))
        results = place / "results/dsec"
        found.append([pd.read_csv(results / f"{name}.csv") for name in ("eqs", "study")])
    for eqs, study in found[1:]:
        pd.testing.assert_frame_equal(eqs, found[0][0], check_exact=True)
        pd.testing.assert_frame_equal(study, found[0][1], check_exact=True)
    eqs, study = found[0]
    # Only four of the paper's five sequences are here, as their first frames.
    assert set(eqs["sequence"]) == {
        "interlaken_00_c_first5", "zurich_city_01_e_first5", "zurich_city_14_b_first5",
        "thun_01_a_first5",
    }  # fmt: skip
    assert set(eqs["system"]) == {"esim", "v2e", "pix2nvs"}
    assert set(study["system"]) == {"real", "v2e"}


def test_the_papers_study_composes():
    cfg = composed("evaluate", "experiment=paper", "data.root=nowhere")
    data = instantiate(cfg.data)
    assert (data.name, data.first_frames, data.crop_rows) == ("dsec", 300, 448)
    assert len(data.scored) == 5
    assert set(cfg.simulators) == {"esim", "v2e", "pix2nvs"}
    asked = composed("train", "experiment=paper", "sim=v2e/paper", "data.root=nowhere")
    assert instantiate(cfg.simulators.v2e) == instantiate(asked.sim)
    # Which sequences are scored changes no training.
    plain = composed("train", "data=dsec", "sim=v2e/paper", "data.root=nowhere")
    assert recipe_hash(asked) == recipe_hash(plain)
