"""The lines of the table are the same work, or their ratio means nothing."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from eqs.benchmarks.scoring import SET_UP, Job, histograms, pair
from eqs.metrics import Judge


class Counted:
    """A judge's network that remembers how many windows of how many streams it has seen."""

    def __init__(self, network):
        self.network, self.seen = network, []

    def __getattr__(self, name):
        return getattr(self.network, name)

    def taps(self, x, *arguments, **options):
        self.seen.append(x.shape[0] * x.shape[1])
        return self.network.taps(x, *arguments, **options)


@pytest.mark.parametrize("what", SET_UP)
def test_every_line_sends_both_streams_through_the_network_once(what, monkeypatch):
    network = Counted(Judge.random().backbone)
    monkeypatch.setattr(Judge, "load", lambda _: SimpleNamespace(backbone=network))
    silence = 0 if what == "passes" else 21  # windows of the response to silence
    run = SET_UP[what](Job(what, (32, 48), 3))
    for _ in range(2):
        network.seen.clear()
        run()
        assert sum(network.seen) == 2 * 3 + silence


def test_histograms_hold_the_events_of_the_windows():
    job = Job("score", (32, 48), 3)
    counted, streams = histograms(job), pair(job)
    for tensor, events in zip(counted, streams, strict=True):
        assert tensor.shape == (3, 20, 32, 48)
        assert tensor.dtype == torch.uint8
        # Counts saturate at ten, so compare where none does.
        cells = np.bincount(events.y * 48 + events.x, minlength=32 * 48).reshape(32, 48)
        total = tensor.sum(dim=(0, 1), dtype=torch.int64).numpy()
        assert (total <= cells).all()
        assert total.sum() > 0.9 * cells.sum()
