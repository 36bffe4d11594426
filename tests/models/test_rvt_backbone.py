"""The backbone: sequences, padding, states and taps."""

import pytest
import torch

from eqs.models import TAPS, RVTBackbone, detach_states, gather_frames, reset_states


@pytest.fixture(scope="module")
def backbone():
    torch.manual_seed(0)
    model = RVTBackbone(in_channels=4, embed_dim=8, head_dim=4, partition_split_32=1).eval()
    for name, parameter in model.named_parameters():
        if name.endswith("gamma"):
            torch.nn.init.normal_(parameter)
    return model


def close(first, second, **tolerance):
    torch.testing.assert_close(first, second, **({"rtol": 1e-5, "atol": 1e-6} | tolerance))


@torch.no_grad()
def test_a_sequence_equals_its_steps_and_its_chunks(backbone):
    x = torch.randint(0, 11, (5, 2, 4, 32, 64), dtype=torch.uint8)
    whole, final = backbone.forward_sequence(x)
    states = None
    for step in range(5):
        features, states = backbone(x[step], states)
        for stage in range(4):
            close(features[stage], whole[stage][step])
    head, states_after = backbone.forward_sequence(x[:2])
    tail, states_after = backbone.forward_sequence(x[2:], states_after)
    for stage in range(4):
        close(torch.cat((head[stage], tail[stage])), whole[stage])
        for other in (states, states_after):
            close(other[stage][0], final[stage][0])
            close(other[stage][1], final[stage][1])


def test_portions_of_frames_give_the_same_maps_and_gradients(backbone, monkeypatch):
    x = torch.randn(5, 2, 4, 32, 64)
    results = []
    for cached in (1 << 21, 1 << 10, 1):
        monkeypatch.setattr("eqs.models.backbone.CACHED_VALUES", cached)
        features, _ = backbone.forward_sequence(x)
        taps, _ = backbone.taps(x, None, (1, 4), ("conv", "window", "gate"))
        maps = [*features, *(each for stages in taps.values() for each in stages)]
        loss = sum(each.square().sum() for each in features)
        results.append((*maps, *torch.autograd.grad(loss, list(backbone.parameters()))))
    for other in results[1:]:
        for first, second in zip(results[0], other, strict=True):
            close(first, second, rtol=1e-4, atol=1e-4)


@torch.no_grad()
def test_a_factor_on_all_counts_leaves_no_trace(backbone):
    # The first convolution has no bias and a norm follows: what EQS is blind to by construction.
    x = torch.poisson(torch.full((3, 1, 4, 32, 64), 2.0)) + 1.0
    once, _ = backbone.forward_sequence(x)
    thrice, _ = backbone.forward_sequence(3.0 * x)
    for first, second in zip(once, thrice, strict=True):
        close(first, second, rtol=1e-2, atol=2e-3)


@torch.no_grad()
@pytest.mark.parametrize("size", [(33, 50), (32, 64), (1, 1)])
def test_padding_is_zeros_at_the_right_and_bottom(backbone, size):
    height, width = size
    x = torch.randn(1, 4, height, width)
    rows, columns = -(-height // 32) * 32, -(-width // 32) * 32
    padded = torch.zeros(1, 4, rows, columns)
    padded[..., :height, :width] = x
    features, _ = backbone(x)
    for feature, expected in zip(features, backbone(padded)[0], strict=True):
        assert torch.equal(feature, expected)
    strides = [rows // feature.shape[-2] for feature in features]
    assert strides == [4, 8, 16, 32]


@torch.no_grad()
def test_split_two_pads_to_multiples_of_64_and_halves_the_partition():
    backbone = RVTBackbone(4, 8, 4, partition_split_32=2)
    features, _ = backbone(torch.zeros(1, 4, 65, 64))
    assert [tuple(feature.shape[-2:]) for feature in features] == [
        (32, 16),
        (16, 8),
        (8, 4),
        (4, 2),
    ]
    _, partition = backbone._prepare(torch.zeros(1, 1, 4, 448, 640))
    assert partition == (7, 10)


@torch.no_grad()
def test_taps_agree_with_the_run_and_with_each_other(backbone):
    x = torch.randn(3, 2, 4, 32, 32)
    states = [(torch.randn_like(h), torch.randn_like(c)) for h, c in backbone(x[0])[1]]
    taps, after = backbone.taps(x, states, stages=(3, 1), names=TAPS)
    features, final = backbone.forward_sequence(x, states)
    assert len(after) == 3
    for (hidden, cell), (expected_hidden, expected_cell) in zip(after, final, strict=False):
        assert torch.equal(hidden, expected_hidden)
        assert torch.equal(cell, expected_cell)
    for index, stage in enumerate((3, 1)):
        tap = {name: maps[index] for name, maps in taps.items()}
        assert torch.equal(tap["hidden"], features[stage - 1])
        close(tap["gate"], tap["gate_logits"].sigmoid())
        close(tap["hidden"], tap["gate"] * tap["cell"].tanh())
        before = torch.cat((states[stage - 1][1][None], tap["cell"][:-1]))
        close(tap["cell"], tap["forget_gate"] * before + tap["input_gate"] * tap["candidate"])
        normed = torch.nn.functional.layer_norm(tap["conv"].movedim(2, -1), tap["conv"].shape[2:3])
        close(tap["downsample"], normed.movedim(-1, 2), atol=1e-5)


@torch.no_grad()
def test_taps_stop_after_the_last_stage(backbone, monkeypatch):
    for stage in backbone.stages[2:]:
        monkeypatch.setattr(stage, "forward", None)
    taps, states = backbone.taps(torch.zeros(1, 1, 4, 32, 32), None, (1, 2), ("gate",))
    assert len(taps["gate"]) == len(states) == 2


@pytest.mark.parametrize("options", [{"names": ("gates",)}, {"stages": (0,)}, {"stages": ()}])
def test_unknown_taps_are_named(backbone, options):
    with pytest.raises(ValueError, match=r"Expected stages from 1 to 4 and taps among conv, .*got"):
        backbone.taps(torch.zeros(1, 1, 4, 32, 32), **options)


def test_wrong_channels_and_states_are_named(backbone):
    with pytest.raises(ValueError, match=r"Expected event tensors of 4 channels.*got \(1, 1, 6, "):
        backbone(torch.zeros(1, 6, 32, 32))
    _, states = backbone(torch.zeros(1, 4, 32, 32))
    with pytest.raises(ValueError, match=r"Expected a state of shape \(1, 8, 8, 16\) for stage 1"):
        backbone(torch.zeros(1, 4, 32, 64), states)


@torch.no_grad()
def test_reset_gives_the_chosen_samples_a_fresh_start(backbone):
    x = torch.randn(2, 2, 4, 32, 32)
    _, states = backbone(x[0])
    kept, _ = backbone(x[1], states)
    fresh, _ = backbone(x[1])
    mixed, _ = backbone(x[1], reset_states(states, torch.tensor([False, True])))
    for stage in range(4):
        close(mixed[stage][0], kept[stage][0])
        close(mixed[stage][1], fresh[stage][1])
    assert reset_states(None, torch.tensor([True])) is None


def test_detached_states_end_the_gradient(backbone):
    assert detach_states(None) is None
    _, states = backbone(torch.randn(1, 4, 32, 32))
    assert all(x.requires_grad for state in states for x in state)
    assert not any(x.requires_grad for state in detach_states(states) for x in state)


def test_gathered_frames_come_in_time_major_order():
    maps = [torch.randn(3, 2, 4, 5, 6), torch.randn(3, 2, 8, 2, 3)]
    keep = torch.tensor([[False, True], [True, False], [True, True]])
    for found, feature in zip(gather_frames(maps, keep), maps, strict=True):
        assert torch.equal(found, feature[keep])
    for found, feature in zip(gather_frames(maps, torch.ones_like(keep)), maps, strict=True):
        assert torch.equal(found, feature.flatten(0, 1))
