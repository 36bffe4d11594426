"""The Event Quality Score with the real backbone, tiny and with random weights."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from eqs.events import Events
from eqs.metrics import (
    ACTIVATIONS,
    Definition,
    EventQualityScore,
    Judge,
    Reading,
    anchors,
    feature_centres,
    score_streams,
)
from eqs.models import RVTDetector
from eqs.representations import soft_histogram

PAPER = {"features": "raw", "distance": "cosine", "patch_size": 3}
BASE = Definition(architecture="rvt-tiny-split1", **PAPER)
HEADLINE = Definition(architecture="rvt-tiny-split1")
SETTINGS = {"size": "tiny", "partition_split_32": 1}
HEIGHT, WIDTH = 40, 56  # neither a multiple of 32


def moving_edges(seed, duration_us=400_000, count=30_000):
    """Edges that cross the sensor: structure in space and time, unlike Poisson noise."""
    generator = np.random.default_rng(seed)
    t = np.sort(generator.integers(0, duration_us, count))
    edge = generator.integers(0, 5, count)
    start, speed = generator.uniform(0, WIDTH, 5), generator.uniform(30, 120, 5)
    x = (start[edge] + speed[edge] * t * 1e-6 + generator.normal(0, 0.5, count)) % WIDTH
    y = generator.integers(0, HEIGHT, count)
    polarity = generator.random(count) < np.where(edge % 2, 0.9, 0.1)
    return Events.from_arrays(
        t=t, x=x.astype(int) % WIDTH, y=y, p=polarity.astype(int), height=HEIGHT, width=WIDTH
    )


@pytest.fixture(scope="module")
def judge():
    return Judge.random(**SETTINGS).backbone


@pytest.fixture(scope="module")
def readings(judge):
    centres = feature_centres(
        judge, [moving_edges(8), moving_edges(9)], taps=ACTIVATIONS, definition=BASE
    )
    plain = [
        Reading(definition=replace(each, tap=tap))
        for tap in ACTIVATIONS
        for each in (BASE, HEADLINE)
    ]
    return plain + [
        Reading(definition=replace(BASE, tap=tap, features=features), centre=centre)
        for tap, centre in centres.items()
        for features in ("centred", "whitened")
    ]


@pytest.fixture(scope="module")
def scores(judge, readings):
    real = moving_edges(1)
    table = anchors(real, other=moving_edges(2), frame_times_us=range(0, 400_001, 50_000))
    results = score_streams(
        judge, real, list(table.values()), readings, start_us=0, stop_us=400_000
    )
    return dict(zip(table, results, strict=True))


def test_identity_for_every_tap(scores):
    assert len(scores["identical"]) == 4 * len(ACTIVATIONS)
    for name, score in scores["identical"].items():
        assert score.score == pytest.approx(1, abs=1e-6), name


def test_no_damage_scores_above_identity(scores):
    for anchor, by_reading in scores.items():
        if anchor != "identical":
            assert all(score.score < 1 - 1e-4 for score in by_reading.values()), anchor


def test_more_thinning_scores_lower(scores):
    for name in ("hidden_raw", "hidden_centred", "downsample_raw", "downsample_centred"):
        order = [scores[key][name].score for key in ("identical", "ceiling", "thinned_50", "blank")]
        assert order == sorted(order, reverse=True), name


def test_map_covers_the_image(scores):
    score = scores["chance"]["hidden_raw"]
    assert score.patch_px == 12
    assert score.map.shape == (4, 5)
    assert len(score.by_stage) == 3


def test_chunks_do_not_matter(judge, readings):
    a, b = moving_edges(1), moving_edges(2)
    one, other = (
        score_streams(judge, a, [b], readings, chunk_windows=length)[0] for length in (2, 100)
    )
    for name, score in one.items():
        assert score.score == pytest.approx(other[name].score, abs=1e-5), name


def test_symmetry(judge, readings):
    a, b = moving_edges(1), moving_edges(2)
    limits = {"start_us": 0, "stop_us": 400_000}
    (there,) = score_streams(judge, a, [b], readings, **limits)
    (back,) = score_streams(judge, b, [a], readings, **limits)
    for name, score in there.items():
        assert score.score == pytest.approx(back[name].score, abs=1e-5), name


def test_autocast_outside_does_not_reach_the_score(judge, readings):
    a, b = moving_edges(1), moving_edges(2)
    (plain,) = score_streams(judge, a, [b], readings[:3])
    with torch.autocast("cpu", dtype=torch.bfloat16):
        (cast,) = score_streams(judge, a, [b], readings[:3])
    assert cast.keys() == plain.keys() == {each.name for each in readings[:3]}
    assert all(cast[name].score == plain[name].score for name in plain)


def test_a_bare_checkpoint_judges_as_its_network_does(tmp_path):
    torch.manual_seed(3)
    model = RVTDetector(num_classes=3, **SETTINGS)
    torch.save({"state_dict": model.state_dict()}, tmp_path / "judge.ckpt")
    metric = EventQualityScore(tmp_path / "judge.ckpt", partition_split_32=1)
    direct = EventQualityScore(Judge.of(model.backbone))
    for each in (metric, direct):
        each.update(moving_edges(1), moving_edges(2))
    assert float(metric.compute()) == pytest.approx(float(direct.compute()), abs=1e-7)
    assert metric.weights_sha256 == direct.weights_sha256
    assert metric.definition.architecture == "rvt-tiny-split1"
    with pytest.raises(ValueError, match="Expected 10 bins, as the judge was trained with, got 5"):
        EventQualityScore(tmp_path / "judge.ckpt", bins=5)


def test_gradients_reach_the_times_of_events(judge):
    """The loss through the soft histogram, as the documents show it."""
    metric = EventQualityScore(Judge.of(judge), warmup_windows=0)
    real, made = moving_edges(1), moving_edges(2)
    times = torch.tensor(made.t, dtype=torch.float64, requires_grad=True)
    places = [torch.from_numpy(getattr(made, name).astype(np.int64)) for name in "xyp"]

    def histograms(t, x, y, p):
        windows = []
        for start in range(0, 150_000, 50_000):
            inside = (t.detach() >= start) & (t.detach() < start + 50_000)
            span = {"start_us": start, "stop_us": start + 50_000, "height": HEIGHT, "width": WIDTH}
            windows.append(soft_histogram(t[inside], x[inside], y[inside], p[inside], **span))
        return torch.stack(windows).float()

    fixed = [torch.from_numpy(getattr(real, name).astype(np.int64)) for name in "xyp"]
    target = histograms(torch.from_numpy(real.t).double(), *fixed)
    before = metric.loss(histograms(times, *places), target)
    before.backward()
    assert times.grad.isfinite().all()
    assert (times.grad != 0).sum() > 1000
    moved = times.detach() - 200 * times.grad / times.grad.abs().max()
    assert metric.loss(histograms(moved, *places), target) < before.item()


def test_random_weights_are_seeded_and_leave_the_global_seed_alone():
    torch.manual_seed(5)
    expected = torch.rand(1)
    torch.manual_seed(5)
    digests = [Judge.random(seed, **SETTINGS).weights_sha256 for seed in (0, 0, 1)]
    assert torch.rand(1) == expected
    assert digests[0] == digests[1] != digests[2]


def test_missing_checkpoint_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"gone\.ckpt, got no such file; set eqs\.judge"):
        EventQualityScore(tmp_path / "gone.ckpt")
