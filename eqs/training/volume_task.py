"""Training of EventGAN's network: likelihood of counts, and a critic of sampled ones."""

from __future__ import annotations

from typing import Any

import lightning
import torch
from torch import Tensor
from torch.nn import functional

from eqs.models.volumes import BINS, VolumeCritic, VolumeGenerator, generator_input
from eqs.simulators.learned import Learning

COARSE = 4  # pixels along each side of a coarse cell
CRITIC_RATE = 4e-4
BETAS = (0.5, 0.99)
SMALLEST = 1e-6


def negative_log_likelihood(expected: Tensor, counts: Tensor) -> Tensor:
    """Of Poisson counts, a voxel's mean, without the part that no expectation changes.

    It is least where the expectation is the conditional mean, so numbers of events come out right.

    Example:
        >>> negative_log_likelihood(torch.tensor([1.0]), torch.tensor([3.0])).item()
        0.9999...
    """
    return (expected - counts * torch.log(expected + SMALLEST)).mean()


def coarse(counts: Tensor) -> Tensor:
    """Counts summed over the bins and over cells of 4x4 pixels, shape (N, 2, H / 4, W / 4)."""
    both = counts.unflatten(1, (2, BINS)).sum(dim=2)
    return functional.avg_pool2d(both, COARSE) * COARSE**2


def sampled(expected: Tensor, phases: Tensor) -> Tensor:
    """Whole numbers of events that integrate and fire makes of expected ones.

    The gradient passes as if they were the expected ones, which they are on average.

    Args:
        expected: shape (N, 20, H, W).
        phases: where each pixel and polarity starts, from 0 to below 1, shape (N, 2, H, W).

    Returns:
        Numbers of events, of the same shape.

    Example:
        >>> counts = sampled(torch.full((1, 20, 1, 1), 0.25), torch.zeros(1, 2, 1, 1))
        >>> counts[0, :10, 0, 0].tolist()
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]
    """
    totals = expected.unflatten(1, (2, BINS)).cumsum(dim=2) + phases[:, :, None]
    reached = torch.floor(torch.cat([phases[:, :, None], totals], dim=2))
    counts = reached.diff(dim=2).flatten(1, 2)
    return expected + (counts - expected).detach()


class VolumeTask(lightning.LightningModule):
    """Trains a generator of expected counts, after some epochs against a critic.

    Everything random is drawn from the seed and the number of the batch, so that a training that
    was interrupted goes on to the same weights.

    Args:
        learning: how it learns.
        fold: which of its networks, from 0.
    """

    def __init__(self, learning: Learning, fold: int) -> None:
        """Make both networks, their weights drawn from the seed."""
        super().__init__()
        self.automatic_optimization = False
        self.learning, self.fold = learning, fold
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(learning.seed * 2 + fold)
            self.generator = VolumeGenerator(learning.width)
            self.critic = VolumeCritic()
        self.validation: list[tuple[float, ...]] = []
        self.found: dict[str, float] = {}

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - Lightning's union of many
        """One optimizer each; the generator's rate falls to nothing along a cosine."""
        rates = (self.generator, self.learning.learning_rate), (self.critic, CRITIC_RATE)
        optimizers = [torch.optim.AdamW(net.parameters(), rate, BETAS) for net, rate in rates]
        steps = self.learning.epochs * self.learning.steps_per_epoch
        return optimizers, [torch.optim.lr_scheduler.CosineAnnealingLR(optimizers[0], steps)]

    def training_step(self, batch: tuple[Tensor, Tensor, Tensor], index: int) -> None:
        """One step of the generator, and one of the critic once it takes part."""
        first, second, counts = batch
        number = self.current_epoch * self.learning.steps_per_epoch + index
        draws = torch.Generator().manual_seed(self.learning.seed * 1_000_003 + 2 * number)
        seen = generator_input(first, second, torch.randn(first.shape, generator=draws).to(first))
        expected = self.generator(seen)
        loss = negative_log_likelihood(expected, counts)
        self.log("loss", loss)
        rough = negative_log_likelihood(coarse(expected), coarse(counts))
        loss = loss + self.learning.coarse_weight / (COARSE**2 * 4) * rough
        if self._opposed:
            phases = torch.rand((len(first), 2, *first.shape[1:]), generator=draws).to(first)
            made = sampled(expected, phases)
            self._teach_critic(made.detach(), counts, seen)
            loss = loss - self.learning.adversarial_weight * self.critic(made, seen).mean()
        self._step(0, self.generator, loss)
        self.lr_schedulers().step()  # type: ignore[union-attr]

    @property
    def _opposed(self) -> bool:
        """Whether the critic takes part yet."""
        learning = self.learning
        later = self.current_epoch >= learning.adversarial_after_epochs
        return later and learning.adversarial_weight > 0

    def _teach_critic(self, made: Tensor, counts: Tensor, seen: Tensor) -> None:
        """A step of the critic by the hinge loss."""
        real, false = self.critic(counts, seen), self.critic(made, seen)
        self._step(
            1, self.critic, functional.relu(1 - real).mean() + functional.relu(1 + false).mean()
        )
        right = 0.5 * ((real > 0).float().mean() + (false < 0).float().mean())
        self.log("critic/accuracy", right)

    def _step(self, which: int, network: torch.nn.Module, loss: Tensor) -> None:
        optimizer = self.optimizers()[which]  # type: ignore[index]
        optimizer.zero_grad()
        self.manual_backward(loss)
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()

    def validation_step(self, batch: tuple[Tensor, Tensor, Tensor], index: int) -> None:
        """Sums over a batch from which the measures of an epoch follow."""
        first, second, counts = batch
        draws = torch.Generator().manual_seed(index)
        seen = generator_input(first, second, torch.randn(first.shape, generator=draws).to(first))
        expected = self.generator(seen)
        loss = negative_log_likelihood(expected, counts) * len(first)
        sums = loss, expected.sum(), counts.sum(), (expected * counts).sum()
        powers = expected.square().sum(), counts.square().sum()
        self.validation.append(tuple(float(each) for each in (*sums, *powers, len(first))))

    def on_validation_epoch_end(self) -> None:
        """Likelihood, events per real event, and cosine of expected counts with real ones."""
        loss, expected, counts, product, own, real, pairs = map(
            sum, zip(*self.validation, strict=True)
        )
        self.validation.clear()
        self.found = {
            "nll": loss / pairs,
            "events_per_real_event": expected / counts,
            "cosine": product / (own * real) ** 0.5,
        }
        for name, value in self.found.items():
            self.log(f"val/{name}", value)
