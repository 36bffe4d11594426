"""Attention: the groups it runs in, and the products themselves."""

import pytest
import torch
from torch.nn import functional

from eqs.models import dot_product
from eqs.models.attention import LayerScale, PartitionAttention, scaled_linear
from eqs.models.dot_product import SmallGroupAttention, attend


def by_definition(qkv, num_heads):
    """Head by head: softmax(q k^T / sqrt(d)) v, channels grouped by head, then q, k, v."""
    heads = []
    for part in qkv.chunk(num_heads, dim=-1):
        query, key, value = part.chunk(3, dim=-1)
        scores = query @ key.transpose(1, 2) / query.shape[-1] ** 0.5
        heads.append(scores.softmax(-1) @ value)
    return torch.cat(heads, dim=-1)


@pytest.mark.parametrize("small_group", [0, 6], ids=["fused", "products"])
@pytest.mark.parametrize("num_heads", [1, 3])
def test_both_ways_follow_the_definition(monkeypatch, small_group, num_heads):
    monkeypatch.setitem(dot_product.SMALL_GROUP, torch.float64, small_group)
    qkv = torch.randn(4, 6, 3 * 12, dtype=torch.float64, requires_grad=True)
    weight = torch.randn(4, 6, 12, dtype=torch.float64)
    found, expected = attend(qkv, num_heads), by_definition(qkv, num_heads)
    torch.testing.assert_close(found, expected)
    (gradient,) = torch.autograd.grad((found * weight).sum(), qkv)
    (wanted,) = torch.autograd.grad((expected * weight).sum(), qkv)
    torch.testing.assert_close(gradient, wanted)


def test_gradient_of_small_groups_agrees_with_differences():
    qkv = torch.randn(3, 2, 4, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(SmallGroupAttention.apply, qkv)


def test_large_scores_do_not_overflow():
    qkv = torch.full((1, 4, 12), 1e4)
    torch.testing.assert_close(attend(qkv, 1), torch.full((1, 4, 4), 1e4))


def reference_block(block, x, groups):
    """One group of tokens at a time, by explicit lists of positions."""
    x = x.clone()
    for group in groups:
        rows, columns = zip(*group, strict=True)
        tokens = x[:, rows, columns]
        branch = by_definition(block.self_attn.qkv(block.norm1(tokens)), block.self_attn.num_heads)
        x[:, rows, columns] = tokens + block.ls1.gamma * block.self_attn.proj(branch)
    first, _, last = block.mlp.net
    return x + block.ls2.gamma * last(functional.gelu(first[0](block.norm2(x))))


@pytest.mark.parametrize("kind", ["window", "grid"])
@pytest.mark.parametrize("first_norm", [True, False])
def test_block_attends_within_the_right_tokens(kind, first_norm):
    height, width, (a, b) = 4, 9, (2, 3)
    block = PartitionAttention(8, 4, kind=kind, first_norm=first_norm).double()
    torch.nn.init.normal_(block.ls1.gamma)
    torch.nn.init.normal_(block.ls2.gamma)
    groups = {}
    for row in range(height):
        for column in range(width):
            if kind == "window":
                key = (row // a, column // b)
            else:
                key = (row % (height // a), column % (width // b))
            groups.setdefault(key, []).append((row, column))
    assert all(len(group) == a * b for group in groups.values())
    x = torch.randn(2, height, width, 8, dtype=torch.float64)
    with torch.no_grad():
        expected = reference_block(block, x, groups.values())
        torch.testing.assert_close(block(x, (a, b)), expected)


def test_scaled_linear_is_a_scaled_linear():
    linear, scale = torch.nn.Linear(5, 3), LayerScale(3)
    assert torch.equal(scale.gamma, torch.full((3,), 1e-5))
    torch.nn.init.normal_(scale.gamma)
    x = torch.randn(7, 5)
    torch.testing.assert_close(scaled_linear(x, linear, scale), scale.gamma * linear(x))
