"""Another event camera watches the same worlds: its events lie beside frames that stay."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from eqs.events import EventReader
from eqs.files import PARTIAL
from eqs.scenes import DSECMini, FirstOrderSensor, ReferenceSensor, SequencePlan

TINY = DSECMini(size="32x24", sequences={"train": 1, "test": 1}, frames=3, workers=1)
NAMES = ("mini_train_000_day", "mini_test_000_day")
DAVIS = ReferenceSensor(threshold_on_log=0.3, seed=5)


def watched_by(sensor, **changed):
    return replace(TINY, other_sensor=sensor, **changed)


def content(root):
    return {path.relative_to(root): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def same_events(one, other):
    with EventReader(one) as a, EventReader(other) as b:
        first, second = a.read(), b.read()
    return all(np.array_equal(getattr(first, k), getattr(second, k)) for k in "txyp")


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return TINY.generate(tmp_path_factory.mktemp("watched") / "mini")


@pytest.fixture
def made(monkeypatch):
    """Names of the recordings that were watched during a test."""
    names, watch = [], SequencePlan._watch

    def noted(plan, folder):
        names.append(plan.name)
        return watch(plan, folder)

    monkeypatch.setattr(SequencePlan, "_watch", noted)
    return names


@pytest.mark.parametrize("sensor", [DAVIS, FirstOrderSensor()])
def test_it_sees_what_a_data_set_of_its_own_would_hold(root, tmp_path, sensor):
    before = content(root)
    mini = watched_by(sensor)
    mini.record(mini.generate(root), NAMES)
    alone = replace(TINY, sensor=sensor).generate(tmp_path / "alone")
    for plan in TINY.recordings():
        place = f"{plan.split}/{plan.name}"
        beside = mini.events_file(root, plan.name)
        assert same_events(beside, alone / place / "events/left/events.h5")
        assert not same_events(beside, root / place / "events/left/events.h5")
        for part in ("images", "object_detections"):  # bit for bit
            assert content(root / place / part) == content(alone / place / part)
        assert not list(beside.parents[2].rglob("*.png"))
    assert content(root) == before
    assert mini.sensor_hash == sensor.definition_hash()


def test_the_own_sensor_has_no_folder_beside(root):
    mini = watched_by(ReferenceSensor())
    mini.record(root, NAMES)
    assert mini.events_file(root, NAMES[0]) is None
    assert ReferenceSensor().definition_hash() not in {
        path.name for path in root.parent.glob("*/*")
    }


def test_only_what_is_asked_for_is_made_and_only_once(root, made):
    mini = watched_by(replace(DAVIS, seed=6))
    mini.record(root, NAMES[1:])
    mini.record(root, NAMES[1:])
    assert made == [NAMES[1]]
    assert not mini.events_file(root, NAMES[0]).exists()


def test_an_interruption_keeps_what_is_whole(root, made, monkeypatch):
    mini = watched_by(replace(DAVIS, seed=7))
    render = SequencePlan._write_events

    def cut(plan, folder, *rest):
        if plan.name == NAMES[1]:
            (folder / "events").mkdir()
            raise KeyboardInterrupt
        return render(plan, folder, *rest)

    monkeypatch.setattr(SequencePlan, "_write_events", cut)
    with pytest.raises(KeyboardInterrupt):
        mini.record(root, NAMES)
    assert not mini.events_file(root, NAMES[1]).exists()
    monkeypatch.setattr(SequencePlan, "_write_events", render)
    mini.record(root, NAMES)
    assert made == [*NAMES, NAMES[1]]
    assert not list(root.parent.rglob(f"*{PARTIAL}"))


@pytest.mark.parametrize("change", [{"frames": 2}, {"seed": 1}])
def test_events_of_other_worlds_are_made_anew(root, made, change):
    sensor = replace(DAVIS, seed=8)
    watched_by(sensor).record(root, NAMES[:1])
    watched_by(sensor, **change).record(root, NAMES[:1])
    assert made == [NAMES[0]] * 2


def test_lost_events_are_made_anew(root, made):
    mini = watched_by(replace(DAVIS, seed=9))
    mini.record(root, NAMES[:1])
    mini.events_file(root, NAMES[0]).unlink()
    mini.record(root, NAMES[:1])
    assert made == [NAMES[0]] * 2
    assert mini.events_file(root, NAMES[0]).is_file()


def test_two_that_ask_at_once_share_the_work(root, made):
    mini = watched_by(replace(DAVIS, seed=10))
    both = [threading.Thread(target=mini.record, args=(root, NAMES)) for _ in range(2)]
    for each in both:
        each.start()
    for each in both:
        each.join()
    assert sorted(made) == sorted(NAMES)


def test_a_folder_of_somebody_else_stays(root):
    mini = watched_by(replace(DAVIS, seed=11))
    folder = mini.events_file(root, NAMES[0]).parents[2]
    folder.mkdir(parents=True)
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(ValueError, match=r"Expected no folder .* set data\.root"):
        mini.record(root, NAMES[:1])
    assert (folder / "notes.txt").read_text() == "mine"


def test_rates_are_told_by_day_and_night(tmp_path):
    mini = replace(TINY, sequences={"test": 2}, other_sensor=DAVIS)
    mini.record(mini.generate(tmp_path / "mini"), ["mini_test_000_day", "mini_test_001_night"])
    said = mini.events_said(tmp_path / "mini")
    (plan, _) = mini.recordings()
    with EventReader(mini.events_file(tmp_path / "mini", plan.name)) as reader:
        rate = len(reader) / (1e-6 * plan.duration_us)
    assert said.startswith(f"{rate:,.0f} events per second by day ({rate / 32 / 24:.1f} per pixel")
    assert "per second by night" in said
    assert said != replace(mini, other_sensor=None).events_said(tmp_path / "mini")
