"""One step of training and evaluation, on a tiny detector and made-up windows."""

import re
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from unittest.mock import patch

import pytest
import torch
from torch.optim import SGD
from torch.optim.lr_scheduler import ConstantLR, OneCycleLR

from eqs.data import LabelProtocol
from eqs.models import RVTDetector
from eqs.training import DetectionTask, Selection
from eqs.training.task import ground_truth

WINDOWS, SAMPLES, HEIGHT, WIDTH = 3, 2, 32, 32


@pytest.fixture
def task(monkeypatch: pytest.MonkeyPatch) -> DetectionTask:
    for name in ("log", "log_dict"):  # there is no trainer to log to
        monkeypatch.setattr(DetectionTask, name, lambda *_, **__: None)
    torch.manual_seed(0)
    model = RVTDetector("tiny", num_classes=2, in_channels=4, partition_split_32=1)
    protocol = LabelProtocol(name="two", classes={"car": [2], "pedestrian": [0]})
    return DetectionTask(
        model, partial(SGD, lr=0.1), partial(ConstantLR), protocol, ["own", "real"]
    )


def batch(seed: int = 0, *, first: bool = True) -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    shape = (WINDOWS, SAMPLES, 4, HEIGHT, WIDTH)
    labels = torch.zeros(WINDOWS, SAMPLES, 2, 5)
    labels[..., 0, :] = torch.tensor([1.0, 12.0, 16.0, 10.0, 8.0])
    return {
        "histograms": torch.randint(0, 5, shape, generator=generator, dtype=torch.uint8),
        "labels": labels,
        "labelled": torch.ones(WINDOWS, SAMPLES, dtype=torch.bool),
        "first": torch.full((SAMPLES,), first),
    }


def test_the_loss_reaches_every_parameter(task: DetectionTask) -> None:
    task.training_step(batch(), 0).backward()
    without = [name for name, p in task.model.named_parameters() if p.grad is None]
    assert without == []


def test_states_are_carried_but_cut_from_the_gradient(task: DetectionTask) -> None:
    task.train()
    task.training_step(batch(), 0)
    assert task._train_states is not None
    assert not any(tensor.requires_grad for pair in task._train_states for tensor in pair)
    with torch.no_grad():
        task.eval()
        carried = task.training_step(batch(1, first=False), 1)
        task._train_states = None
        fresh = task.training_step(batch(1), 1)
    assert carried != fresh


def test_a_first_sample_forgets_what_came_before(task: DetectionTask) -> None:
    task.eval()
    with torch.no_grad():
        fresh = task.training_step(batch(1), 0)
        task.training_step(batch(2), 1)
        again = task.training_step(batch(1), 2)
    torch.testing.assert_close(again, fresh, rtol=0, atol=0)


def test_a_resumed_task_takes_its_states_back(task: DetectionTask) -> None:
    task.training_step(batch(), 0)
    checkpoint = {"state_dict": task.state_dict(), "global_step": 1}
    task.on_save_checkpoint(checkpoint)
    states, task._train_states = task._train_states, None
    task.on_load_checkpoint(checkpoint)
    assert states is not None
    assert task._train_states is not None
    for before, after in zip(states, task._train_states, strict=True):
        torch.testing.assert_close(after, before)


def test_a_chunk_without_labels_detects_nothing_but_moves_the_states(task: DetectionTask) -> None:
    task.eval()
    silent = batch()
    silent["labelled"] = torch.zeros_like(silent["labelled"])
    with torch.no_grad():
        assert task.detect(silent) == []
    assert task._evaluation_states is not None


def test_detections_do_not_depend_on_how_windows_are_chunked(task: DetectionTask) -> None:
    task.eval()
    whole = batch()
    parts = [{**whole, "first": torch.full((SAMPLES,), index == 0)} for index in range(WINDOWS)]
    for index, part in enumerate(parts):
        for name in ("histograms", "labels", "labelled"):
            part[name] = whole[name][index : index + 1]
    with torch.no_grad():
        together = task.detect(whole)
        apart = [found for part in parts for found in task.detect(part)]
    assert len(together) == len(apart) == WINDOWS * SAMPLES
    for a, b in zip(together, apart, strict=True):
        torch.testing.assert_close(a["scores"], b["scores"], rtol=1e-4, atol=1e-6)


def test_ground_truth_turns_rows_into_corners_and_drops_padding() -> None:
    rows = torch.tensor([[1.0, 10.0, 20.0, 4.0, 6.0], [0.0, 0.0, 0.0, 0.0, 0.0]])
    truth = ground_truth(rows)
    assert truth["boxes"].tolist() == [[8.0, 17.0, 12.0, 23.0]]
    assert truth["labels"].tolist() == [1]


def test_detections_below_the_size_limits_drop_out_when_asked(task: DetectionTask) -> None:
    task.eval()
    protocol = task.protocol
    task.selection = Selection(protocol, confidence_threshold=0.0, nms_threshold=1.0)
    with torch.no_grad():
        everything = task.detect(batch())[0]
        task._evaluation_states = None
        asked = replace(protocol, min_side_px=9.0, filter_detections=True)
        task.selection = replace(task.selection, protocol=asked)
        large = task.detect(batch())[0]
    sides = everything["boxes"][:, 2:] - everything["boxes"][:, :2]
    keep = (sides >= 9.0).all(1)
    assert 0 < keep.sum() < len(keep)
    torch.testing.assert_close(large["boxes"], everything["boxes"][keep])


def test_a_loss_that_is_not_finite_stops_and_says_where(task: DetectionTask) -> None:
    rates = SimpleNamespace(optimizers=[SGD(task.parameters(), lr=0.125)], global_step=7)
    with torch.no_grad():
        task.model.yolox_head.obj_preds[0].bias.fill_(float("nan"))
    with (
        patch.object(DetectionTask, "trainer", rates),
        pytest.raises(ValueError, match=r"loss = nan at step 7 .* rate of 0.125 .*; set recipe"),
    ):
        task.training_step(batch(), 0)


@pytest.mark.parametrize("broken", [float("nan"), float("inf")])
def test_broken_weights_are_not_kept(task: DetectionTask, broken: float) -> None:
    state = {name: value.clone() for name, value in task.state_dict().items()}
    state["model.yolox_head.obj_preds.0.bias"][:] = broken
    with pytest.raises(ValueError, match=r"finite weights after step 5, got NaN or infinity in mo"):
        task.on_save_checkpoint({"state_dict": state, "global_step": 5})


def test_an_interrupted_test_leaves_nothing_behind(task: DetectionTask) -> None:
    task.eval()
    with torch.no_grad():
        task.on_test_epoch_start()
        task.test_step(batch(), 0)  # and cut
        task.on_test_epoch_start()
        task.test_step(batch(), 0)
        task.test_step(batch(), 0, 1)
    task.on_test_epoch_end()
    assert task.measured["own"] == task.measured["real"]


def test_a_longer_training_takes_its_schedule_up_where_the_shorter_one_ended() -> None:
    def optimiser_and_schedule(steps: int):
        optimiser = SGD([torch.nn.Parameter(torch.zeros(1))], lr=0.1)
        return optimiser, OneCycleLR(optimiser, max_lr=0.1, total_steps=steps)

    def advance(optimiser, schedule, steps: int) -> None:
        for _ in range(steps):
            optimiser.step()
            schedule.step()

    model = RVTDetector("tiny", num_classes=2, in_channels=4, partition_split_32=1)
    protocol = LabelProtocol(name="two", classes={"car": [2], "pedestrian": [0]})
    schedule = partial(OneCycleLR, max_lr=0.1, total_steps=40)
    task = DetectionTask(model, partial(SGD, lr=0.1), schedule, protocol)
    optimiser, short = optimiser_and_schedule(20)
    advance(optimiser, short, 20)
    checkpoint = {"lr_schedulers": [short.state_dict()], "train_states": None}
    task.on_load_checkpoint(checkpoint)
    optimiser, going_on = optimiser_and_schedule(20)
    going_on.load_state_dict(checkpoint["lr_schedulers"][0])
    reference, long = optimiser_and_schedule(40)
    advance(reference, long, 20)
    advance(optimiser, going_on, 1)
    advance(reference, long, 1)
    assert optimiser.param_groups[0]["lr"] == pytest.approx(reference.param_groups[0]["lr"])


class Toy(torch.nn.Module):
    """Predicts a box per frame from the mean count, without states."""

    def __init__(self) -> None:
        super().__init__()
        self.linear = torch.nn.Linear(1, 7)

    def forward_sequence(self, histograms, states):
        return [histograms.mean((2, 3, 4), keepdim=True)], states

    def loss(self, features, labels):
        return {"loss": self.detect(features).square().mean()}

    def detect(self, features):
        return self.linear(features[0].flatten(1))[:, None]


@pytest.mark.parametrize(
    ("method", "returns", "sentence"),
    [
        (None, None, None),
        ("forward_sequence", (torch.zeros(3, 2, 1, 1, 1), None), "a list of maps (3, 2, C, h, w)"),
        ("forward_sequence", ([torch.zeros(3, 2, 1, 1, 1)], [torch.zeros(1)]), "each of 2 samples"),
        ("loss", torch.zeros(()), "scalars by name with one called loss"),
        ("detect", torch.zeros(6, 9, 6), "predictions (6, A, 7)"),
    ],
)
def test_a_detector_that_keeps_no_promise_is_told_so(
    task: DetectionTask, monkeypatch: pytest.MonkeyPatch, method, returns, sentence
) -> None:
    toy = DetectionTask(Toy(), partial(SGD, lr=0.1), partial(ConstantLR), task.protocol)
    if method is not None:
        monkeypatch.setattr(toy.model, method, lambda *_: returns)

    def two_steps() -> None:
        for step in range(2):
            toy.training_step(batch(step, first=False), step)
        with torch.no_grad():
            assert len(toy.detect(batch())) == WINDOWS * SAMPLES

    if sentence is None:
        two_steps()
    else:
        with pytest.raises(ValueError, match=re.escape(sentence)):
            two_steps()


def test_what_is_no_detector_is_refused(task: DetectionTask) -> None:
    with pytest.raises(ValueError, match="got a Linear without forward_sequence, loss, detect"):
        DetectionTask(torch.nn.Linear(1, 1), SGD, ConstantLR, task.protocol)


def test_a_checkpoint_says_what_the_detector_is(task: DetectionTask) -> None:
    task.record = {"bins": 2}
    task.training_step(batch(), 0)
    checkpoint = {"state_dict": task.state_dict(), "global_step": 1}
    task.on_save_checkpoint(checkpoint)
    size = {"height": HEIGHT, "width": WIDTH}
    assert checkpoint["detector"] == {"bins": 2, **size, "class_names": ["car", "pedestrian"]}
    assert checkpoint["partition_split_32"] == 1
