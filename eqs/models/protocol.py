"""What a training asks of a detector, whichever it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from torch import Tensor, nn

from eqs.models.states import Carried

METHODS = ("forward_sequence", "loss", "detect")


class Detector(Protocol):
    """A `torch.nn.Module` that is trained, tested and filmed like RVT.

    Convention: states are tensors whose first axis is the sample, in lists, tuples and dicts of any
    depth, or None for a detector without. Zeros mean the same as no state at all: a sample that
    starts a new sequence has its states set to zero. Between two steps states are cut from the
    gradient and kept in checkpoints; nobody else looks inside.
    """

    def forward_sequence(
        self, histograms: Tensor, states: Carried
    ) -> tuple[Sequence[Tensor], Carried]:
        """Run consecutive windows.

        Args:
            histograms: float (T, N, channels, H, W), T windows of N samples in order of time.
            states: what the call before returned, None at the start.

        Returns:
            Features of every window, maps (T, N, C, h, w) of any number and size, of which the
            labelled windows come back to `loss` and `detect`; and the states after the last window.
        """

    def loss(self, features: Sequence[Tensor], labels: Tensor) -> dict[str, Tensor]:
        """What is wrong with F labelled frames.

        Args:
            features: maps (F, C, h, w).
            labels: (F, M, 5) rows class, cx, cy, w, h in pixels; rows of zeros are padding.

        Returns:
            Scalars by name, all of which are logged; the one called `loss` is minimised.
        """

    def detect(self, features: Sequence[Tensor]) -> Tensor:
        """Predictions (F, A, 5 + classes) of F frames, any number A of them.

        Convention: columns are cx, cy, w, h in pixels, objectness and class confidences, both in
        [0, 1]. Thresholds and non-maximum suppression follow outside.
        """


def require_detector(model: nn.Module) -> None:
    """See that a module has what a training asks of it.

    Raises:
        ValueError: a method is missing.
    """
    missing = [name for name in METHODS if not callable(getattr(model, name, None))]
    if missing:
        raise ValueError(
            f"Expected a detector with {', '.join(METHODS)}, got a {type(model).__name__} without "
            f"{', '.join(missing)}; set model"
        )


def check_features(features: Sequence[Tensor], windows: int, samples: int) -> None:
    """Refuse features that are not maps of every window.

    Raises:
        ValueError: they are not a list of maps, or of other windows or samples.
    """
    shapes = [tuple(each.shape) for each in features]
    if isinstance(features, Tensor) or any(
        len(shape) != 5 or shape[:2] != (windows, samples) for shape in shapes
    ):
        raise ValueError(
            f"Expected features as a list of maps ({windows}, {samples}, C, h, w), got "
            f"{'a tensor' if isinstance(features, Tensor) else shapes}; "
            "change the detector's forward_sequence"
        )


def check_losses(losses: dict[str, Tensor]) -> None:
    """Refuse losses without the one that is minimised.

    Raises:
        ValueError: they are no scalars by name, or `loss` is not among them.
    """
    given = losses if isinstance(losses, dict) else {}
    if "loss" not in given or any(each.ndim for each in given.values()):
        found = {name: tuple(each.shape) for name, each in given.items()}
        raise ValueError(
            f"Expected scalars by name with one called loss, got {found or type(losses).__name__}; "
            "change the detector's loss"
        )


def check_predictions(predictions: Tensor, frames: int, classes: int) -> None:
    """Refuse predictions that are not boxes of every frame.

    Raises:
        ValueError: there are other frames, or columns for fewer classes.
    """
    shape = tuple(predictions.shape)
    if len(shape) != 3 or shape[0] != frames or shape[2] < 5 + classes:
        raise ValueError(
            f"Expected predictions ({frames}, A, {5 + classes}), columns cx, cy, w, h, objectness "
            f"and {classes} classes, got {shape}; change the detector's detect, or set "
            "model.num_classes"
        )
