"""Five optimizer steps of the published training module, replayed by ours."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.optim import AdamW
from torch.optim.lr_scheduler import OneCycleLR

from eqs.data import LabelProtocol
from eqs.training import DetectionTask

GOLDEN = Path(__file__).parents[1] / "golden" / "rvt" / "train.npz"
LOSSES = ("loss", "iou_loss", "conf_loss", "cls_loss", "l1_loss", "num_fg")


def batch_of(data, meta, step):
    """One merged batch: the stream sample, then the random one, which is always a first one."""
    histograms = torch.from_numpy(data["x"][step])
    rows = data["labels"][data["labels"][:, 0] == step]
    labels = torch.zeros(*histograms.shape[:2], 8, 5)
    for time, sample in np.unique(rows[:, 1:3].astype(int), axis=0):
        found = rows[(rows[:, 1] == time) & (rows[:, 2] == sample)]
        left, top, width, height, label = found[:, 4:9].T
        boxes = np.stack([label, left + width / 2, top + height / 2, width, height], axis=1)
        labels[time, sample, : len(boxes)] = torch.from_numpy(boxes)
    return {
        "histograms": histograms,
        "labels": labels,
        "labelled": (labels[..., 3] > 0).any(-1),
        "first": torch.tensor([meta["first_flag_of_stream"][step], True]),
    }


@pytest.fixture(scope="module")
def replay(filled):
    """Losses and rates of every step, gradient norms, and the trained task."""
    with np.load(GOLDEN) as file:
        data = {key: file[key] for key in file.files}
    meta = json.loads(str(data["meta"]))
    plan = {key: meta["scheduler"][key] for key in ("total_steps", "pct_start", "div_factor")}
    task = DetectionTask(
        filled("tiny", num_classes=2).train(),
        partial(AdamW, lr=meta["learning_rate"], weight_decay=0.0),
        # The published module divides the last factor by the first.
        partial(
            OneCycleLR,
            max_lr=meta["learning_rate"],
            final_div_factor=meta["scheduler"]["final_div_factor"] / plan["div_factor"],
            anneal_strategy="linear",
            cycle_momentum=False,
            **plan,
        ),
        LabelProtocol(name="two", classes={"car": [0], "pedestrian": [1]}),
    )
    threads = torch.get_num_threads()
    torch.set_num_threads(2)  # each number sums in an order of its own
    logged, losses, rates, norms = {}, [], [], []
    task.log, task.log_dict = (lambda *_, **__: None), logged.update
    made = task.configure_optimizers()
    optimizer, schedule = made["optimizer"], made["lr_scheduler"]["scheduler"]
    states = {}
    for step, worker in enumerate(meta["worker_of_step"]):
        task._train_states = states.get(worker)
        loss = task.training_step(batch_of(data, meta, step), step)
        states[worker] = task._train_states
        optimizer.zero_grad()
        loss.backward()
        losses.append([float(logged[f"train/{name}"]) for name in LOSSES])
        rates.append(schedule.get_last_lr()[0])
        norms.append([float(p.grad.norm()) for p in task.model.parameters()])
        torch.nn.utils.clip_grad_value_(task.model.parameters(), 1.0)
        optimizer.step()
        schedule.step()
    yield data, {"losses": losses, "lr": rates, "grad_norms": norms}, task, states
    torch.set_num_threads(threads)


def test_learning_rates(replay):
    data, found, *_ = replay
    np.testing.assert_allclose(found["lr"], data["lr"], rtol=1e-9)


def test_losses_of_every_step(replay):
    data, found, *_ = replay
    # Rounding grows from step to step: the reference's own distance from float64 reaches 2e-3.
    np.testing.assert_allclose(found["losses"][:4], data["losses"][:4], rtol=2e-4, atol=1e-5)
    np.testing.assert_allclose(found["losses"][4], data["losses"][4], rtol=2e-3, atol=1e-5)


def test_gradient_norms_of_every_step(replay):
    data, found, task, _ = replay
    names = [name for name, _ in task.model.named_parameters()]
    assert names == [str(name) for name in data["param_names"]]
    for step, tolerance in enumerate((1e-3, 1e-3, 2e-3, 2e-2, 2e-2)):
        ours, theirs = np.array(found["grad_norms"][step]), data["grad_norms"][step]
        assert np.abs(ours - theirs).max() <= tolerance * theirs.max()


def test_weights_and_statistics_after_the_last_step(replay):
    data, _, task, _ = replay
    state = task.model.state_dict()
    names = [key.removeprefix("final/") for key in data if key.startswith("final/")]
    assert len(names) == 10
    for name in names:
        np.testing.assert_allclose(
            state[name].numpy(), data[f"final/{name}"], rtol=0, atol=1e-3, err_msg=name
        )


def test_every_worker_keeps_its_own_states(replay):
    data, *_, states = replay
    for worker in (0, 1):
        for stage in (1, 4):
            for kind, tensor in zip("hc", states[worker][stage - 1], strict=True):
                expected = data[f"state_w{worker}_{kind}{stage}"]
                np.testing.assert_allclose(tensor.numpy(), expected, rtol=0, atol=2e-3)
