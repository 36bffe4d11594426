"""The detector as a whole: sizes, training under autocast, configuration."""

from pathlib import Path

import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from eqs.models import RVTDetector, reset_states

CONFIGS = Path(__file__).parents[2] / "eqs/configs"


@torch.no_grad()
def test_one_process_serves_several_resolutions():
    model = RVTDetector("tiny", num_classes=3).eval()
    for height, width, padded in (
        (96, 128, (128, 128)),
        (60, 90, (64, 128)),
        (96, 128, (128, 128)),
    ):
        predictions, states = model(torch.zeros(1, 20, height, width, dtype=torch.uint8))
        anchors = sum(padded[0] // s * padded[1] // s for s in (8, 16, 32))
        assert predictions.shape == (1, anchors, 8)
        assert len(states) == 4
        # The first anchor of the coarsest level sits at the origin, its stride is 32.
        assert predictions[0, -1, 0] > padded[1] - 3 * 32


def frames(steps=2, samples=2):
    generator = torch.Generator().manual_seed(5)
    x = torch.randint(0, 4, (steps, samples, 20, 32, 64), generator=generator, dtype=torch.uint8)
    labels = torch.zeros(steps * samples, 2, 5)
    labels[:, 0] = torch.tensor([1.0, 30.0, 16.0, 24.0, 14.0])
    return x, labels


def test_bfloat16_training_is_close_to_float32():
    torch.manual_seed(0)
    # Running statistics: a batch norm over a handful of pixels would amplify the rounding.
    model = RVTDetector("tiny", partition_split_32=1).eval()
    x, labels = frames()
    found = {}
    for enabled in (False, True):
        model.zero_grad()
        with torch.autocast("cpu", torch.bfloat16, enabled=enabled):
            features, _ = model.backbone.forward_sequence(x)
            losses = model.loss([feature.flatten(0, 1) for feature in features], labels)
        assert losses["loss"].dtype == torch.float32
        losses["loss"].backward()
        gradient = torch.cat([p.grad.flatten() for p in model.parameters()])
        assert gradient.isfinite().all()
        found[enabled] = losses["loss"].detach(), gradient
    torch.testing.assert_close(found[True][0], found[False][0], rtol=0.03, atol=0)
    assert torch.cosine_similarity(found[True][1], found[False][1], dim=0) > 0.95


def test_a_few_steps_learn_one_scene():
    torch.manual_seed(0)
    model = RVTDetector("tiny", partition_split_32=1).train()
    optimizer = torch.optim.Adam(model.parameters(), 3e-3)
    x, labels = frames(samples=1)
    values = []
    states = None
    for _ in range(12):
        states = reset_states(states, torch.tensor([True]))
        features, _ = model.backbone.forward_sequence(x, states)
        loss = model.loss([feature.flatten(0, 1) for feature in features], labels)["loss"]
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        values.append(loss.item())
    assert values[-1] < 0.8 * values[0]


def test_loss_takes_stages_one_to_four_or_two_to_four():
    model = RVTDetector("tiny", partition_split_32=1).eval()
    x, labels = frames(steps=1)
    with torch.no_grad():
        features, _ = model.backbone(x[0])
        assert torch.equal(
            model.loss(features, labels)["loss"], model.loss(features[1:], labels)["loss"]
        )
    with pytest.raises(ValueError, match=r"Expected labels \(2, M, 5\).*got \(1, 2, 5\)"):
        model.loss(features, labels[:1])


def test_unknown_sizes_and_counts_are_named():
    with pytest.raises(ValueError, match="Expected one of tiny, small, base, got 'huge'; set"):
        RVTDetector("huge")
    with pytest.raises(ValueError, match=r"Expected positive num_classes.*got 0, 20 and 2"):
        RVTDetector("tiny", num_classes=0)


@pytest.mark.parametrize("size", ["tiny", "small", "base"])
def test_configurations_build_their_size(size):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose(overrides=[f"+model=rvt_{size}"]).model
    # These come from other groups of the whole configuration.
    config.num_classes, config.partition_split_32, config.layer_scale_init = 3, 2, 0.1
    config.in_channels, config.open_recurrence, config.first_box_strides = 20, True, [2.0, 3.0]
    model = instantiate(config)
    assert (model.size, model.num_classes, model.backbone.multiple) == (size, 3, 64)
    gammas = [value for name, value in model.named_parameters() if name.endswith("gamma")]
    assert len(gammas) == 16
    assert all((gamma == 0.1).all() for gamma in gammas)


@torch.no_grad()
def test_first_boxes_have_the_size_asked_for():
    torch.manual_seed(0)
    model = RVTDetector("tiny", first_box_strides=(2.0, 3.0)).eval()
    boxes = model(torch.zeros(1, 20, 64, 64))[0][0, :64]
    expected = torch.tensor([[4.0, 4.0], [12.0, 4.0], [20.0, 4.0]])
    torch.testing.assert_close(boxes[:3, :2], expected, atol=1.0, rtol=0)
    torch.testing.assert_close(boxes[:, 2:4].mean(0), torch.tensor([16.0, 24.0]), atol=1.5, rtol=0)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # PyTorch's compiler warns about itself
def test_compiled_stages_are_the_same_function():
    torch.manual_seed(0)
    model = RVTDetector("tiny", partition_split_32=1, layer_scale_init=1.0)
    x, _ = frames(steps=2, samples=1)
    names = list(model.state_dict())
    found = {}
    for compiled in (False, True):
        if compiled:
            model.compile_stages(backend="eager")
        model.zero_grad()
        maps, _ = model.backbone.forward_sequence(x)
        maps[-1].square().sum().backward()
        weight = model.backbone.stages[0].downsample_cf2cl.conv.weight
        found[compiled] = maps[-1].detach(), weight.grad.clone()
    torch.testing.assert_close(found[True], found[False], rtol=1e-4, atol=1e-5)
    assert list(model.state_dict()) == names


def test_a_detector_that_has_looked_can_still_learn():
    model = RVTDetector("tiny", partition_split_32=1, num_classes=3)
    x, labels = frames()
    with torch.inference_mode():
        maps, _ = model.backbone.forward_sequence(x.float())
        model.detect([level.flatten(0, 1) for level in maps])
    maps, _ = model.backbone.forward_sequence(x.float())
    model.loss([level.flatten(0, 1) for level in maps], labels)["loss"].backward()
    assert all(parameter.grad is not None for parameter in model.yolox_head.parameters())
