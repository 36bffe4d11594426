"""Networks of one's own: what is asked of them, and what is said of maps that do not fit."""

import re

import pytest
import torch

from eqs.metrics import Definition, EventQualityScore, Judge
from eqs.metrics.features import check_maps

FITTING = [torch.zeros(3, 2, 5, 5, 7), torch.zeros(3, 2, 5, 4, 4)]


@pytest.mark.parametrize(
    "shown",
    [
        {},
        {"seen": FITTING[:1]},
        {"seen": [FITTING[0], FITTING[1][..., :3]]},
        {"seen": [FITTING[0], FITTING[1][:, :1]]},
        {"seen": [FITTING[0], FITTING[1][0]]},
    ],
)
def test_maps_of_other_shapes_are_named(shown):
    histograms = (3, 2, 20, 20, 28)
    check_maps({"seen": FITTING}, ["seen"], [4, 8], histograms)  # the second is padded
    wanted = "tap seen by stage of shapes [(3, 2, 'C', 5, 7), (3, 2, 'C', 3, 4)] or, padded"
    with pytest.raises(ValueError, match=re.escape(wanted)):
        check_maps(shown, ["seen"], [4, 8], histograms)


def test_a_metric_refuses_them_too(backbone, make_events):
    backbone.strides = (1, 4, 8)
    metric = EventQualityScore(Judge.of(backbone, bins=2))
    with pytest.raises(ValueError, match="change the strides or the taps of the network"):
        metric.update(make_events(1), make_events(2))


def test_the_definition_follows_what_a_network_has(backbone):
    backbone.strides, backbone.tap_names, backbone.in_channels = (2, 4), ("now", "hidden"), 4
    assert Judge.of(backbone).definition == Definition(
        architecture="SmallBackbone", stages=(1, 2), bins=2
    )
    backbone.tap_names = ("now", "then")
    assert Judge.of(backbone).definition.tap == "now"
    assert Judge.of(backbone, tap="then").definition.tap == "then"
    with pytest.raises(ValueError, match="Expected a tap among now, then, got hidden"):
        Judge.of(backbone).define(tap="hidden")


def test_the_same_settings_give_the_same_network_and_others_another(tmp_path):
    shape = {"size": "tiny", "partition_split_32": 1}
    settings = {"_target_": "eqs.models.RVTDetector", **shape}
    with pytest.raises(ValueError, match="RVTDetector without taps, tap_names, strides, in_"):
        Judge.built(settings)
    kind = {"_target_": f"{__name__}.Stage"}
    one, same, other = (Judge.built({**kind, "width": width}) for width in (3, 3, 4))
    assert one.weights_sha256 == same.weights_sha256 != other.weights_sha256
    assert one.definition.hash == same.definition.hash != other.definition.hash
    one.save(tmp_path)
    loaded = Judge.load(tmp_path)
    assert (loaded.definition, loaded.weights_sha256) == (one.definition, one.weights_sha256)
    assert one.untrained(1).weights_sha256 != one.weights_sha256


class Stage(torch.nn.Module):
    """One convolution that shows what it sees."""

    in_channels, strides, tap_names = 20, (4,), ("seen",)

    def __init__(self, width):
        super().__init__()
        self.conv = torch.nn.Conv2d(20, width, 4, stride=4)

    def taps(self, x, states, *, stages, names):
        seen = self.conv(x.flatten(0, 1)).unflatten(0, x.shape[:2])
        return {name: [seen] for name in names}, None
