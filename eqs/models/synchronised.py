"""What several training processes share, so that together they compute what one would."""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, distributed, nn

from eqs.models.context import Context


def processes() -> int:
    """How many processes train together."""
    together = distributed.is_available() and distributed.is_initialized()
    return distributed.get_world_size() if together else 1


class SumOverProcesses(torch.autograd.Function):
    """The sum of every process's value; its gradient is the sum of every process's gradient."""

    @staticmethod
    def forward(ctx: Context, value: Tensor) -> Tensor:
        """Add up; `value` stays as it is."""
        total = value.clone(memory_format=torch.contiguous_format)
        distributed.all_reduce(total)
        return total

    @staticmethod
    def backward(ctx: Context, grad: Tensor) -> Tensor:
        """Every process's result depends on every process's value."""
        total = grad.clone(memory_format=torch.contiguous_format)
        distributed.all_reduce(total)
        return total


def mean_over_processes(value: Tensor) -> Tensor:
    """The mean of every process's value; gradients flow back to all of them."""
    if processes() > 1:
        mean: Tensor = SumOverProcesses.apply(value) / processes()  # type: ignore[no-untyped-call]
        return mean
    return value


class SyncBatchNorm(nn.BatchNorm2d):
    """Batch norm over the batches of all processes, on any device.

    PyTorch's own insists on a GPU.
    """

    @classmethod
    def convert(cls, module: nn.Module) -> nn.Module:
        """Replace every `BatchNorm2d` below `module`, keeping parameters and statistics."""
        for name, child in module.named_children():
            if isinstance(child, nn.BatchNorm2d):
                norm = cls(child.num_features, eps=child.eps, momentum=child.momentum)
                norm.load_state_dict(child.state_dict())
                setattr(module, name, norm.to(child.weight.device).train(child.training))
            else:
                cls.convert(child)
        return module

    def forward(self, x: Tensor) -> Tensor:
        """Normalise (B, C, H, W) with the mean and variance of all processes' batches."""
        if not self.training or processes() == 1:
            return super().forward(x)
        exact = x.float()
        # Processes may hold batches of different sizes; each channel's sums go by their shares.
        share = mean_over_processes(exact.new_tensor(exact[:, 0].numel()))
        mean = mean_over_processes(exact.sum((0, 2, 3)) / share)
        centred = exact - mean[:, None, None]
        variance = mean_over_processes(centred.square().sum((0, 2, 3)) / share)
        self._follow(mean.detach(), variance.detach(), float(share) * processes())
        scale = self.weight * (variance + self.eps).rsqrt()
        return (centred * scale[:, None, None] + self.bias[:, None, None]).to(x.dtype)

    @torch.no_grad()
    def _follow(self, mean: Tensor, variance: Tensor, count: float) -> None:
        momentum = cast(float, self.momentum)
        cast(Tensor, self.num_batches_tracked).add_(1)
        cast(Tensor, self.running_mean).lerp_(mean, momentum)
        cast(Tensor, self.running_var).lerp_(variance * count / max(count - 1, 1), momentum)
