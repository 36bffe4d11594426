"""EventGAN's losses and sampler: unbiased, of whole numbers, with the gradient of the mean."""

import math

import numpy as np
import pytest
import torch
from tiny_school import Teacher

from eqs.models.volumes import VolumeCritic, VolumeGenerator, generator_input
from eqs.simulators import Learning
from eqs.simulators.learned.firing import integrate_and_fire
from eqs.training.volume_task import coarse, negative_log_likelihood, sampled


def test_the_likelihood_is_best_at_the_mean_of_the_counts():
    counts = torch.tensor([0.0, 0.0, 1.0, 3.0])
    levels = torch.linspace(0.5, 2, 151)
    losses = [negative_log_likelihood(level.expand(4), counts).item() for level in levels]
    assert levels[int(np.argmin(losses))].item() == pytest.approx(1.0, abs=0.011)


def test_what_the_critic_sees_is_what_is_fired():
    """The straight-through sampler counts the events of the simulator's own one."""
    random = torch.Generator().manual_seed(0)
    expected = torch.rand((1, 20, 6, 8), generator=random) * 1.5
    phases = torch.rand((1, 2, 6, 8), generator=random)
    counts = sampled(expected, phases)[0].double().numpy().round(6)
    fed = expected[0].double().reshape(2, 10, 48).numpy()
    moved = phases[0].double().reshape(2, 48).numpy().copy()
    _, count = integrate_and_fire(fed, moved, 0, 1_000_000, np.empty(1, np.int64))
    assert count == counts.sum()
    np.testing.assert_allclose(counts, counts.round())


def test_the_gradient_is_that_of_the_mean_over_phases():
    """Finite differences of the mean number, over many phases, against the straight gradient."""
    expected = torch.full((1, 20, 1, 1), 0.3, requires_grad=True)
    phases = torch.rand((4000, 2, 1, 1), generator=torch.Generator().manual_seed(1))
    weights = torch.linspace(0.5, 2, 20)[:, None, None]

    def mean(values):
        return (sampled(values.expand(4000, -1, -1, -1), phases) * weights).sum() / 4000

    (gradient,) = torch.autograd.grad(mean(expected), expected)
    torch.testing.assert_close(gradient[0], weights)
    step = 0.05
    with torch.no_grad():
        for index in (0, 7, 19):
            moved = expected.detach().clone()
            moved[0, index] += step
            # A larger expectation moves all later events forward; in sum the mean goes up by it.
            total = (sampled(moved.expand(4000, -1, -1, -1), phases)).sum() / 4000
            before = (sampled(expected.expand(4000, -1, -1, -1), phases)).sum() / 4000
            assert ((total - before) / step).item() == pytest.approx(1, abs=0.25)


def test_coarse_counts_are_sums():
    counts = torch.rand(2, 20, 8, 12)
    rough = coarse(counts)
    assert rough.shape == (2, 2, 2, 3)
    assert rough[1, 1, 1, 2].item() == pytest.approx(counts[1, 10:, 4:, 8:].sum().item(), rel=1e-5)


@pytest.mark.parametrize("size", [(96, 128), (17, 30), (1, 1)])
def test_the_networks_take_images_of_any_size(size):
    generator, critic = VolumeGenerator(8), VolumeCritic()
    levels = torch.rand(2, *size) * 255
    seen = generator_input(levels, levels.flip(0), torch.zeros(2, *size))
    counts = generator(seen)
    assert counts.shape == (2, 20, *size)
    assert (counts >= 0).all()
    assert counts.mean().item() == pytest.approx(math.log1p(math.exp(-3)), rel=0.9)
    if min(size) >= 8:
        assert critic(counts, seen).shape[:2] == (2, 1)


def test_a_batch_is_learned_to_nearly_its_entropy():
    """Counts that follow from the frames: 200 steps come within a tenth of what is possible."""
    random = np.random.default_rng(0)
    first, second = (torch.from_numpy(random.uniform(20, 230, (2, 16, 16))).float() for _ in "ab")
    seen = generator_input(first, second, torch.zeros_like(first))
    truth = 0.05 + 0.5 * (seen[:, 2] > 0).float()[:, None].expand(-1, 20, -1, -1)
    counts = torch.poisson(truth, generator=torch.Generator().manual_seed(2))
    torch.manual_seed(0)
    generator = VolumeGenerator(8)
    optimizer = torch.optim.AdamW(generator.parameters(), 5e-3)
    losses = []
    for _ in range(200):
        loss = negative_log_likelihood(generator(seen), counts)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    possible = negative_log_likelihood(truth, counts).item()
    flat = negative_log_likelihood(counts.mean().expand_as(counts), counts).item()
    assert losses[-1] < possible + 0.1 * (flat - possible)


def test_equal_seeds_start_with_equal_weights_and_folds_differ(tmp_path):
    from eqs.training.volume_task import VolumeTask

    learning = Learning(teacher=Teacher(), root=tmp_path, width=8)
    first, again, other = (VolumeTask(learning, fold) for fold in (0, 0, 1))
    heads = [task.generator.head[0].weight for task in (first, again, other)]
    assert torch.equal(heads[0], heads[1])
    assert not torch.equal(heads[0], heads[2])
