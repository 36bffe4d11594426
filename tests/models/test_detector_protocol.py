"""States of any nesting, and what is said of detectors that keep no promise."""

from typing import NamedTuple

import pytest
import torch

from eqs.models import detach_states, reset_states
from eqs.models.protocol import check_features, check_losses, check_predictions
from eqs.models.states import map_states, of_all_processes, of_this_process


class Named(NamedTuple):
    hidden: torch.Tensor


def nested():
    return {"a": [torch.ones(2, 3), None], "b": (torch.full((2, 1, 4, 4), 2.0),)}


def test_a_sample_that_starts_anew_has_zeros_everywhere_and_the_other_what_it_had():
    states = reset_states(nested(), torch.tensor([True, False]))
    assert states["a"][0].tolist() == [[0, 0, 0], [1, 1, 1]]
    assert states["a"][1] is None
    assert states["b"][0].flatten(1).unique(dim=1).tolist() == [[0], [2]]
    assert reset_states(None, torch.tensor([True])) is None
    assert reset_states((), torch.tensor([True])) == ()


def test_detached_states_keep_their_values_and_lose_their_history():
    state = torch.ones(2, requires_grad=True) * 2
    (detached,) = detach_states([state])
    assert not detached.requires_grad
    assert torch.equal(detached, state)


def test_tensors_of_one_place_go_together():
    both = map_states(lambda a, b: torch.cat((a, b)), nested(), nested())
    assert both["a"][0].shape == (4, 3)
    assert both["b"][0].shape == (4, 1, 4, 4)


def test_alone_a_process_has_all_states():
    states = nested()
    assert of_all_processes(states) is states
    torch.testing.assert_close(of_this_process(states)["b"], states["b"])


def test_other_containers_and_axes_are_refused():
    with pytest.raises(ValueError, match=r"lists, tuples and dicts, got a Named; change the det"):
        detach_states(Named(torch.ones(1)))
    with pytest.raises(ValueError, match=r"each of 3 samples along the first axis, got shape \(2"):
        reset_states([torch.ones(2, 3)], torch.zeros(3, dtype=torch.bool))
    with pytest.raises(ValueError, match=r"got shape \(\); change"):
        reset_states([torch.ones(())], torch.zeros(3, dtype=torch.bool))


@pytest.mark.parametrize(
    "features",
    [torch.zeros(3, 2, 1, 4, 4), [torch.zeros(2, 3, 1, 4, 4)], [torch.zeros(3, 2, 4, 4)]],
)
def test_features_are_maps_of_every_window(features):
    check_features([torch.zeros(3, 2, 1, 4, 4), torch.zeros(3, 2, 7, 2, 2)], 3, 2)
    with pytest.raises(ValueError, match=r"a list of maps \(3, 2, C, h, w\), got .*; change"):
        check_features(features, 3, 2)


@pytest.mark.parametrize(
    "losses", [torch.zeros(()), {"box": torch.zeros(())}, {"loss": torch.ones(2)}]
)
def test_losses_are_scalars_with_the_one_to_minimise(losses):
    check_losses({"loss": torch.zeros(()), "box": torch.zeros(())})
    with pytest.raises(ValueError, match=r"Expected scalars by name with one called loss, got "):
        check_losses(losses)


@pytest.mark.parametrize("shape", [(3, 9, 7), (2, 9, 6), (9, 7)])
def test_predictions_are_boxes_of_every_frame(shape):
    check_predictions(torch.zeros(2, 9, 7), 2, 2)
    with pytest.raises(ValueError, match=r"predictions \(2, A, 7\), .* 2 classes, got \("):
        check_predictions(torch.zeros(shape), 2, 2)
