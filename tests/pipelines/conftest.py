"""Records of finished runs."""

import pytest

from eqs.metrics import Accuracy
from eqs.pipelines.result import RunResult


def result_of(simulator: str, **changed: object) -> RunResult:
    """A plausible record."""
    by_class = {"car": 0.25, "pedestrian": 0.125}
    accuracy = Accuracy(
        map=0.25,
        map_50=0.5,
        map_75=0.25,
        map_small=0.125,
        map_medium=0.5,
        map_large=-1.0,
        map_per_class=by_class,
        map_50_per_class=by_class,
        ground_truths_per_class={"car": 3.0, "pedestrian": 7.0},
    )
    fields = {
        "simulator": simulator,
        "system": simulator,
        "seed": 0,
        "recipe": "old",
        "data": "then",
        "own": accuracy,
        "real": accuracy,
        "protocol": {"name": "coco", "hash": "0"},
        "seconds": 1.5,
        "stages": ({simulator: 1.0},),
    }
    return RunResult(**{**fields, **changed})


@pytest.fixture(name="result_of")
def result_of_fixture():
    """`result_of` as a fixture."""
    return result_of
