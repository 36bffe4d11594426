"""The histogram with gradients."""

import numpy as np
import pytest
import torch

from eqs.events import Events
from eqs.representations import soft_histogram, stacked_histogram

WINDOW = {"start_us": 1_000, "stop_us": 51_000, "height": 6, "width": 8}


def columns(count=40, seed=0):
    generator = torch.Generator().manual_seed(seed)
    t = 1_000 + 50_000 * torch.rand(count, generator=generator, dtype=torch.float64)
    x = torch.randint(0, 8, (count,), generator=generator)
    y = torch.randint(0, 6, (count,), generator=generator)
    return t, x, y, torch.randint(0, 2, (count,), generator=generator)


def test_gradients_agree_with_differences():
    t, x, y, p = columns(12)
    weights = torch.rand(12, dtype=torch.float64)
    # In microseconds a difference of 1e-6 vanishes; in windows it does not.
    window = {"start_us": 0.0, "stop_us": 1.0, "height": 6, "width": 8, "bins": 4}
    given = ((t - 1_000) / 50_000).requires_grad_(), weights.requires_grad_()
    assert torch.autograd.gradcheck(
        lambda time, weight: soft_histogram(time, x, y, p, weight, **window), given
    )


def test_every_event_counts_once_however_it_is_shared():
    t, x, y, p = columns(400)
    counts = soft_histogram(t, x, y, p, count_cutoff=None, **WINDOW)
    assert float(counts.sum()) == pytest.approx(400)
    per_pixel = counts.view(2, 10, 6, 8).sum(1)
    assert float(per_pixel[1].sum()) == pytest.approx(int(p.sum()))


def test_an_event_in_the_middle_of_a_bin_counts_for_it_alone():
    zero = torch.zeros(3, dtype=torch.long)
    middles = torch.tensor([1_000.0, 3_500.0, 50_999.0])
    counts = soft_histogram(middles, zero, zero, zero, **WINDOW)[:10, 0, 0]
    assert counts.tolist() == [2.0] + [0.0] * 8 + [1.0]


def test_hard_counts_are_those_of_the_detector_with_soft_gradients():
    t, x, y, p = columns(3_000, seed=1)
    t = t.floor().sort().values.requires_grad_()
    weights = torch.ones_like(t).requires_grad_()
    hard = soft_histogram(t, x, y, p, weights, hard=True, **WINDOW)
    events = Events.from_arrays(
        t=t.detach().long().numpy(), x=x.numpy(), y=y.numpy(), p=p.numpy(), height=6, width=8
    )
    expected = stacked_histogram(events, start_us=1_000, stop_us=51_000)
    assert np.array_equal(hard.detach().numpy(), expected)
    value = torch.randn(20, 6, 8, dtype=torch.float64)
    soft = soft_histogram(t, x, y, p, weights, **WINDOW)
    found = torch.autograd.grad((hard * value).sum(), (t, weights), retain_graph=True)
    for one, other in zip(
        found, torch.autograd.grad((soft * value).sum(), (t, weights)), strict=True
    ):
        torch.testing.assert_close(one, other)


def test_events_outside_the_window_have_no_part():
    zero = torch.zeros(2, dtype=torch.long)
    t = torch.tensor([999.0, 51_000.0], requires_grad=True)
    counts = soft_histogram(t, zero, zero, zero, **WINDOW)
    counts.square().sum().backward()
    assert counts.sum() == 0
    assert t.grad.tolist() == [0.0, 0.0]


def test_whole_times_and_empty_windows_are_refused():
    zero = torch.zeros(1, dtype=torch.long)
    with pytest.raises(ValueError, match="floating times"):
        soft_histogram(zero, zero, zero, zero, **WINDOW)
    with pytest.raises(ValueError, match="ends after it starts"):
        soft_histogram(zero.float(), zero, zero, zero, **{**WINDOW, "stop_us": 0})
