"""The two crossing rules against each other and against exact counts."""

from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eqs.simulators.pixel.crossing import crossing_share, levels_passed, officially_crossed

THRESHOLDS = st.integers(1, 200)
DIFFERENCES = st.integers(-3000, 3000)


@settings(deadline=None)  # the first call compiles
@given(DIFFERENCES, THRESHOLDS, THRESHOLDS)
def test_levels_passed_equals_exact_division(difference, on, off):
    exact = Fraction(difference, on) if difference > 0 else Fraction(difference, off)
    count = int(exact)  # towards zero
    assert levels_passed(difference / 100, on / 100, off / 100) == count


@settings(deadline=None)
@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-5, 5))
def test_shares_lie_within_the_interval(level, first, last):
    assert 0 <= crossing_share(level, first, last) <= 1


def test_an_overdue_level_fires_at_the_start():
    assert crossing_share(0.1, 0.3, 0.8) == 0.0


@pytest.mark.parametrize(
    ("level", "accepted"), [(0.0, False), (0.5, True), (1.0, True), (1.01, False)]
)
def test_the_official_rule_takes_levels_beyond_the_start_up_to_the_end(level, accepted):
    assert officially_crossed(level, 0.0, 1.0, 1) == accepted
    assert officially_crossed(-level, 0.0, -1.0, -1) == accepted
