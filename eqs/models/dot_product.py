"""Softmax attention within many small groups of tokens."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional

from eqs.models.context import Context

# Up to so many tokens, products of whole groups beat PyTorch's fused kernel on the CPU: in float32
# because of its overhead for tiny groups, in half precision because of its slow backward pass.
SMALL_GROUP = {torch.float32: 16, torch.bfloat16: 512}


class SmallGroupAttention(torch.autograd.Function):
    """Attention as batched products of whole groups, with its own backward pass."""

    @staticmethod
    def forward(ctx: Context, qkv: Tensor) -> Tensor:
        """Mix the values of (3, groups, tokens, d): queries, keys, values."""
        query, key, value = qkv
        # In float32 the softmax is both more exact and, on the CPU, faster than in bfloat16.
        exact = torch.promote_types(qkv.dtype, torch.float32)
        scores = query.bmm(key.transpose(1, 2)).to(exact).mul_(qkv.shape[-1] ** -0.5)
        scores = scores.sub_(scores.amax(-1, keepdim=True)).exp_()
        weights = scores.div_(scores.sum(-1, keepdim=True)).to(qkv.dtype)
        mixed: Tensor = weights.bmm(value)
        ctx.save_for_backward(qkv, weights, mixed)
        return mixed

    @staticmethod
    @once_differentiable
    def backward(ctx: Context, grad: Tensor) -> Tensor:
        """Gradients of queries, keys and values, written to one tensor."""
        qkv, weights, mixed = ctx.saved_tensors
        query, key, value = qkv
        out = torch.empty_like(qkv)
        torch.bmm(weights.transpose(1, 2), grad, out=out[2])
        exact = torch.promote_types(qkv.dtype, torch.float32)
        inner = (grad * mixed).sum(-1, keepdim=True, dtype=exact)
        scores = grad.bmm(value.transpose(1, 2)).to(exact).sub_(inner)
        scores = scores.mul_(weights).mul_(qkv.shape[-1] ** -0.5).to(qkv.dtype)
        torch.bmm(scores, key, out=out[0])
        torch.bmm(scores.transpose(1, 2), query, out=out[1])
        return out


def attend(qkv: Tensor, num_heads: int) -> Tensor:
    """Attention within groups, every head on its own.

    Args:
        qkv: (groups, tokens, 3 * C).
        num_heads: heads that share the channels.

    Returns:
        Mixed values (groups, tokens, C).

    Convention: channels of `qkv` are grouped by head first, within a head query, key, value.
    """
    groups, tokens, channels = qkv.shape
    split = qkv.view(groups, tokens, num_heads, 3, -1)
    if qkv.device.type == "cpu" and tokens <= SMALL_GROUP.get(qkv.dtype, 0):
        by_head = split.permute(3, 0, 2, 1, 4).reshape(3, groups * num_heads, tokens, -1)
        with torch.autocast("cpu", enabled=False):
            mixed: Tensor = SmallGroupAttention.apply(by_head)  # type: ignore[no-untyped-call]
        mixed = mixed.view(groups, num_heads, tokens, -1)
    else:
        query, key, value = split.transpose(1, 2).unbind(3)
        mixed = functional.scaled_dot_product_attention(query, key, value)
    return mixed.transpose(1, 2).reshape(groups, tokens, channels // 3)
