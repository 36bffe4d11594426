"""The mixed-density stack against the published program and by hand."""

import json
from pathlib import Path

import numpy as np
import pytest

from eqs.events import Events
from eqs.representations import mixed_density_stack

GOLDEN = Path(__file__).parents[1] / "golden" / "rvt" / "representations.npz"


def golden_cases():
    stored = np.load(GOLDEN)
    for key in stored.files:
        if "_mixed_" in key:
            name, _, cut = key.split("_")
            limit = cut.removeprefix("cut")
            yield pytest.param(name, None if limit == "None" else int(limit), key, id=key)


@pytest.mark.parametrize(("name", "cutoff", "key"), list(golden_cases()))
def test_span_of_events_equals_the_published_program(name, cutoff, key):
    stored = np.load(GOLDEN)
    meta = json.loads(str(stored["meta"]))
    fields = {field: stored[f"{name}_{field}"] for field in "txyp"}
    events = Events.from_arrays(**fields, height=meta["H"], width=meta["W"])
    result = mixed_density_stack(events, meta["bins"], cutoff=cutoff, span="events", wrap=True)
    np.testing.assert_array_equal(result, stored[key])


def test_the_last_channel_holds_every_event(make_events):
    events = make_events(500, stop_us=50_000)
    result = mixed_density_stack(events, 6, 0, 50_000, cutoff=None)
    sums = np.zeros((events.height, events.width), int)
    np.add.at(sums, (events.y, events.x), 2 * events.p.astype(int) - 1)
    np.testing.assert_array_equal(result[-1], sums)


@pytest.mark.parametrize(("t", "channel"), [(60, 3), (99, 3), (30, 2), (49, 2), (20, 1), (2, 0)])
def test_stretches_halve_towards_the_past(t, channel):
    events = Events.from_arrays([t], [0], [0], [1], height=1, width=1)
    shown = mixed_density_stack(events, 4, 0, 100)[:, 0, 0]
    assert shown.tolist() == [0] * channel + [1] * (4 - channel)


def test_sums_saturate_unless_they_shall_wrap():
    events = Events.from_arrays([0] * 300, [0] * 300, [0] * 300, [1] * 300, height=1, width=1)
    assert mixed_density_stack(events, 1, 0, 9, cutoff=None)[0, 0, 0] == 127
    assert mixed_density_stack(events, 1, 0, 9, cutoff=None, wrap=True)[0, 0, 0] == 300 - 256


@pytest.mark.parametrize("options", [{"bins": 0}, {"cutoff": 200}, {"cutoff": -1}])
def test_impossible_settings_are_refused(make_events, options):
    with pytest.raises(ValueError, match="Expected at least 1 bin and a cutoff from 0 to 127"):
        mixed_density_stack(make_events(5), **options)
