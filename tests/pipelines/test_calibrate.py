"""The search for a simulator's parameters, on a score whose best point is known."""

import numpy as np
import pytest

from eqs.data import RecordedEvents
from eqs.pipelines.calibrate import Range, Search, check, run
from eqs.simulators import V2E
from eqs.study import calibration_table

CONTRAST = Range(parameters=("threshold_on_log", "threshold_off_log"), low=0.05, high=1.0)
BANDWIDTH = Range(parameters=("cutoff_hz",), low=3.0, high=1000.0)


class Hill:
    """A clip whose score is highest at one contrast and bandwidth."""

    def __init__(self, contrast, bandwidth):
        self.best = np.log([contrast, bandwidth])

    def score(self, judge, simulator):
        assert simulator.threshold_on_log == simulator.threshold_off_log
        place = np.log([simulator.threshold_on_log, simulator.cutoff_hz])
        return 1 - np.square((place - self.best) * [1.0, 0.5]).sum()


def search(contrast=0.25, bandwidth=100.0, **start):
    simulator = V2E(**{"threshold_on_log": 0.8, "threshold_off_log": 0.8, "cutoff_hz": 10, **start})
    return Search(None, simulator, [CONTRAST, BANDWIDTH], [Hill(contrast, bandwidth)])


def test_a_detuned_simulator_is_brought_back():
    looking = search()
    best = run(looking, 60)
    assert best.threshold_on_log == pytest.approx(0.25, rel=0.1)
    assert best.threshold_off_log == best.threshold_on_log
    assert best.cutoff_hz == pytest.approx(100, rel=0.2)
    assert len(looking.tried) <= 60
    assert looking.tried[0]["threshold_on_log"] == pytest.approx(0.8)
    assert best.leak_hz == V2E().leak_hz


def test_values_stay_within_their_bounds():
    looking = search(contrast=0.001)
    best = run(looking, 40)
    assert min(tried["threshold_on_log"] for tried in looking.tried) >= CONTRAST.low
    assert best.threshold_on_log == pytest.approx(CONTRAST.low)


def test_a_start_at_a_bound_is_left_the_other_way():
    looking = search(threshold_on_log=1.0, threshold_off_log=1.0)
    run(looking, 5)
    assert len({tried["threshold_on_log"] for tried in looking.tried}) > 1


def test_what_cannot_be_searched_is_named():
    check(V2E(), [CONTRAST, BANDWIDTH])
    with pytest.raises(ValueError, match=r"Expected a simulator to calibrate, got sim=real"):
        check(RecordedEvents(), [CONTRAST])
    missing = Range(parameters=("colour",), low=1.0, high=2.0)
    with pytest.raises(ValueError, match="v2e to have a colour between"):
        check(V2E(), [missing])
    with pytest.raises(ValueError, match=r"cutoff_hz between 3\.0 and 1000\.0, got 0"):
        check(V2E(cutoff_hz=0), [BANDWIDTH])


def test_measures_are_means_over_recordings():
    table = calibration_table({"before": [{"eqs": 0.2}, {"eqs": 0.4}], "after": [{"eqs": 0.5}]})
    assert table.loc["eqs"].tolist() == pytest.approx([0.3, 0.5])
