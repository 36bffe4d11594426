"""Our detector against outputs of the published one, on weights made from parameter names."""

import zlib

import numpy as np
import pytest
import torch

from eqs.models import TAPS, RVTDetector, detection_loss, postprocess
from eqs.models.assignment import assign
from eqs.models.yolox_head import decode_boxes

STATE = {"atol": 5e-5, "rtol": 0}
PYRAMID = {"atol": 1e-4, "rtol": 0}
DECODED = {"atol": 2e-4, "rtol": 1e-5}
LOSSES = ("loss", "iou_loss", "conf_loss", "cls_loss", "l1_loss", "num_fg")
TAP_KEYS = {
    "conv": "conv",
    "downsample": "down",
    "window": "win",
    "attention": "grid",
    "forget_gate": "gate_f",
    "input_gate": "gate_i",
    "gate": "gate_o",
    "candidate": "cell_in",
}


def flat(features):
    return [feature.flatten(0, 1) for feature in features]


@pytest.mark.parametrize(
    ("size", "classes", "entries", "parameters", "checksum"),
    [
        ("tiny", 2, 376, 4_405_141, 657727757),
        ("small", 2, 376, 9_870_165, 4020786585),
        ("small", 3, 376, 9_870_456, 3441487546),
        ("base", 3, 424, 18_536_856, 2525624938),
    ],
)
def test_names_shapes_and_order_are_the_published_ones(
    fill_rule, size, classes, entries, parameters, checksum
):
    model = RVTDetector(size, num_classes=classes)
    state = model.state_dict()
    assert len(state) == entries
    assert sum(parameter.numel() for parameter in model.parameters()) == parameters
    found = 0
    for name, tensor in state.items():
        value = np.ascontiguousarray(fill_rule(name, tensor.shape))
        found = zlib.crc32(value.tobytes(), found)
    assert found == checksum


def test_states_over_time_step_by_step(filled, golden):
    data = golden("backbone_tiny")
    backbone = filled("tiny").eval().backbone
    states = None
    with torch.no_grad():
        for step, x in enumerate(data["x"]):
            features, states = backbone(x, states)
            for stage in range(4):
                torch.testing.assert_close(states[stage][0], data[f"h{stage + 1}"][step], **STATE)
                torch.testing.assert_close(states[stage][1], data[f"c{stage + 1}"][step], **STATE)
                torch.testing.assert_close(features[stage], states[stage][0], rtol=0, atol=0)


def test_states_over_time_stage_by_stage(filled, golden):
    data = golden("backbone_tiny")
    with torch.no_grad():
        features, states = filled("tiny").eval().backbone.forward_sequence(data["x"])
    for stage in range(4):
        torch.testing.assert_close(features[stage], data[f"h{stage + 1}"], **STATE)
        torch.testing.assert_close(states[stage][1], data[f"c{stage + 1}"][-1], **STATE)


def test_small_states_taps_and_predictions(filled, golden):
    data = golden("small")
    model = filled("small").eval()
    with torch.no_grad():
        features, states = model.backbone.forward_sequence(data["x"])
        taps, _ = model.backbone.taps(data["x"], None, (2, 3), TAPS)
        predictions = model.detect([feature[-1] for feature in features])
    for stage in range(4):
        torch.testing.assert_close(states[stage][0][0], data[f"h{stage + 1}"], **STATE)
        torch.testing.assert_close(states[stage][1][0], data[f"c{stage + 1}"], **STATE)
    for name, key in TAP_KEYS.items():
        for index, stage in enumerate((2, 3)):
            torch.testing.assert_close(taps[name][index][-1, 0], data[f"{key}{stage}"], **STATE)
    torch.testing.assert_close(predictions[0], data["decoded"], **DECODED)


def test_pyramid_and_decoded_predictions(filled, golden):
    frames, data = golden("backbone_tiny"), golden("detector_tiny")
    model = filled("tiny").eval()
    features = [frames[f"h{stage}"].flatten(0, 1) for stage in (2, 3, 4)]
    with torch.no_grad():
        levels = model.fpn(features)
        predictions = model.detect(features)
    for level, name in zip(levels, ("p3", "p4", "p5"), strict=True):
        torch.testing.assert_close(level, data[name], **PYRAMID)
    torch.testing.assert_close(predictions, data["decoded"], **DECODED)
    _, anchors = model.yolox_head(levels)
    assert torch.equal(anchors[:, :2], data["grids"])
    assert torch.equal(anchors[:, 2], data["strides"])


def test_postprocess(golden):
    data = golden("detector_tiny")
    products = postprocess(data["pp_pred"], 0.1, 0.45)
    confidences = postprocess(data["pp_pred"], 0.1, 0.45, class_score=True)
    assert [len(found["scores"]) for found in products] == data["pp_count"].clamp(min=0).tolist()
    rows = torch.cat([found["boxes"] for found in products])
    assert torch.equal(rows, data["pp_out"][:, :4])
    labels = torch.cat([found["labels"] for found in products])
    assert torch.equal(labels, data["pp_out"][:, 6].long())
    product = torch.cat([found["scores"] for found in products])
    torch.testing.assert_close(product, data["pp_out"][:, 4] * data["pp_out"][:, 5])
    confidence = torch.cat([found["scores"] for found in confidences])
    assert torch.equal(confidence, data["pp_out"][:, 5])


def check_assignment(found, data, case):
    mask = data[f"{case}_fg_mask"]
    row = torch.full(mask.shape, -1)
    row[found.frame, found.anchor] = found.row
    assert torch.equal(row, data[f"{case}_matched_gt"].long())
    iou = torch.zeros(mask.shape)
    iou[found.frame, found.anchor] = found.iou
    # Boxes carry float32 noise of batch statistics here, 1e-4 of their size.
    torch.testing.assert_close(iou[mask], data[f"{case}_matched_iou"][mask], atol=1e-4, rtol=0)


@pytest.mark.parametrize("case", ["a", "b", "c"], ids=["one empty", "all empty", "crowded"])
def test_training_loss_assignment_and_gradients(filled, golden, case):
    data = golden("loss")
    model = filled("tiny").train()
    features, _ = model.backbone.forward_sequence(data["x"])
    features = flat(features)
    for feature, stage in zip(features[1:], (2, 3, 4), strict=True):
        torch.testing.assert_close(feature.detach(), data[f"feat{stage}"], **STATE)
    losses = model.loss(features, data[f"{case}_labels"])
    found = torch.stack([losses[name].detach().double() for name in LOSSES])
    torch.testing.assert_close(found, data[f"{case}_losses"], rtol=1e-5, atol=1e-7)

    losses["loss"].backward()
    parameters = dict(model.named_parameters())
    norms = torch.stack([parameters[name].grad.norm() for name in data["param_names"]])
    torch.testing.assert_close(norms.double(), data[f"{case}_grad_norms"], rtol=5e-4, atol=1e-6)
    for key, expected in data.items():
        if key.startswith(f"{case}_grad/"):
            error = (parameters[key.split("/")[1]].grad - expected).norm()
            assert error <= 5e-4 * expected.norm() + 1e-6, key
    if case == "a":
        state = model.state_dict()
        for key, expected in data.items():
            if key.startswith("bn_after/"):
                torch.testing.assert_close(
                    state[key.removeprefix("bn_after/")], expected, rtol=1e-4, atol=1e-5
                )


@pytest.mark.parametrize("case", ["a", "b", "c"])
def test_assignment_and_l1_loss(filled, golden, case):
    data = golden("loss")
    model = filled("tiny").train()
    features = [data[f"feat{stage}"] for stage in (2, 3, 4)]
    with torch.no_grad():
        raw, anchors = model.yolox_head(model.fpn(features))
        losses = model.loss(features, data[f"{case}_labels"], use_l1=True)
    found = assign(decode_boxes(raw, anchors), raw[..., 4:], anchors, data[f"{case}_labels"])
    check_assignment(found, data, case)
    values = torch.stack([losses[name].double() for name in LOSSES])
    torch.testing.assert_close(values, data[f"{case}_losses_with_l1"], rtol=1e-5, atol=1e-7)


def test_loss_alone(golden):
    data = golden("loss")
    outputs = data["d_outputs"].requires_grad_()
    grid = [data[f"d_{name}"][0] for name in ("x_shifts", "y_shifts", "strides")]
    anchors = torch.stack(grid, dim=1)
    losses = detection_loss(outputs[..., :4], outputs[..., 4:], anchors, data["d_labels"])
    values = torch.stack([losses[name].detach().double() for name in LOSSES])
    torch.testing.assert_close(values, data["d_losses"], rtol=1e-5, atol=1e-7)
    losses["loss"].backward()
    torch.testing.assert_close(outputs.grad, data["d_grad"], rtol=5e-4, atol=1e-7)
    found = assign(outputs[..., :4], outputs[..., 4:], anchors, data["d_labels"])
    check_assignment(found, data, "d")
