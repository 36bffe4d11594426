"""Challengers against closed forms."""

from __future__ import annotations

import pytest
import torch

from eqs.metrics import Definition, EventQualityScore, Judge, patch_cosine, pool_patches
from eqs.metrics.definition import VERSION_1
from eqs.metrics.features import pooled_features
from eqs.metrics.silence import Silence
from eqs.trial import Challengers, Means
from eqs.trial.challengers import HEADLINE, compared, of_counts

CHANNELS = 6


@pytest.fixture
def means() -> Means:
    return Means(centre=torch.full((CHANNELS,), 0.3), covariance=torch.eye(CHANNELS))


def maps(*streams: torch.Tensor) -> torch.Tensor:
    return torch.stack(streams, dim=1)


@pytest.fixture
def real() -> torch.Tensor:
    torch.manual_seed(0)
    return torch.randn(4, CHANNELS, 9, 12)


def test_a_stream_is_itself_to_all(real: torch.Tensor, means: Means) -> None:
    silence = torch.zeros(4, 1, CHANNELS, 9, 12)
    for name, values in compared(maps(real, real), silence, means).items():
        assert values == pytest.approx(torch.ones(4, 1), abs=1e-4), name


def test_silence_agrees_with_nothing(real: torch.Tensor, means: Means) -> None:
    silence = torch.randn(4, 1, CHANNELS, 9, 12)
    found = compared(maps(real, silence[:, 0]), silence, means)
    for name in ("agreement, silence, cells", "agreement, silence, 3x3", "cosine, silence, cells"):
        assert found[name] == pytest.approx(torch.zeros(4, 1), abs=1e-6), name


def test_twice_as_much_agrees_by_four_fifths(real: torch.Tensor, means: Means) -> None:
    silence = torch.zeros(4, 1, CHANNELS, 9, 12)
    found = compared(maps(real, 2 * real), silence, means)
    assert found["agreement, silence, cells"] == pytest.approx(torch.full((4, 1), 0.8), abs=1e-5)
    assert found["cosine, silence, cells"] == pytest.approx(torch.ones(4, 1), abs=1e-5)
    distance = 1 - 0.2**0.5
    assert found["its distance form"] == pytest.approx(torch.full((4, 1), distance), abs=1e-5)


def test_version_1_is_the_cosine_of_centred_patches(real: torch.Tensor, means: Means) -> None:
    other = torch.randn_like(real)
    found = compared(maps(real, other), torch.zeros(4, 1, CHANNELS, 9, 12), means)
    pooled = [pool_patches(each, 3) for each in (other, real)]
    expected = patch_cosine(*pooled, means.centre).mean(dim=(-2, -1))
    assert found["version 1: cosine, mean real, 3x3"][:, 0] == pytest.approx(expected, abs=1e-6)


def test_windows_of_the_warm_up_do_not_count(real: torch.Tensor, means: Means) -> None:
    silence = torch.zeros(4, 1, CHANNELS, 9, 12)
    other = real.clone()
    other[:2] = 5.0
    tally = Challengers([means], skip=2)
    for first in (0, 1, 2):
        step = slice(first, first + 1) if first < 2 else slice(2, 4)
        tally.add([maps(real, other)[step]], [silence[step]], first)
    assert tally.windows == 2
    assert tally.scores()["agreement, silence, cells"].item() == pytest.approx(1.0, abs=1e-6)
    products, squares = tally.channels[0]
    assert products == pytest.approx(squares, rel=1e-6)


def test_counts_see_place_polarity_and_time() -> None:
    torch.manual_seed(1)
    counts = (torch.rand(2, 1, 20, 24, 32) < 0.005).to(torch.uint8)
    moved, flipped = counts.roll(8, dims=-1), counts.roll(10, dims=2)
    late = counts.roll(5, dims=2)
    for name, values in of_counts(torch.cat([counts, counts, moved, flipped, late], 1)).items():
        same, *others = values.mean(dim=0).tolist()
        assert same == pytest.approx(1.0, abs=1e-6), name
        assert max(others) < 0.9, name


def test_two_of_them_are_the_scores_of_the_metric() -> None:
    """The headline, and the one before it with its centre, digit for digit as a user gets them."""
    torch.manual_seed(2)
    real, simulated = torch.poisson(torch.full((2, 12, 20, 48, 64), 0.05)).to(torch.uint8)
    judge = Judge.random(size="tiny", partition_split_32=1).centred_on([real])
    streams = torch.stack([real, simulated], dim=1)
    definition = Definition(patch_size=1)
    (pooled,) = pooled_features(judge.backbone, [streams], definitions=[definition])
    quiet = Silence(judge.backbone).responses([definition], (48, 64), 0, 12)[definition.maps]
    means = [
        Means(centre=each, covariance=torch.eye(len(each)))
        for each in judge.centres[0].for_stages((1, 2, 3))
    ]
    tally = Challengers(means, skip=definition.warmup_of(12))
    tally.add(pooled[definition.maps], quiet, 0)
    for name, chosen in ((HEADLINE, {}), ("version 1: cosine, mean real, 3x3", VERSION_1)):
        metric = EventQualityScore(judge, **chosen)
        metric.update(simulated, real)
        assert tally.scores()[name].item() == pytest.approx(metric.last.score, abs=1e-6), name
