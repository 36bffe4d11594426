"""Simulated streams on disk: written once, reused, renewed when anything changes."""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eqs.data import RecordedEvents, Recording, SimulatedEvents
from eqs.events import Events
from eqs.files import read_json
from eqs.processors import side_by_side
from eqs.simulators import ESIM, V2E


@pytest.fixture
def recording(tmp_path: Path, make_recording) -> Recording:
    return Recording.load(make_recording(tmp_path / "data" / "street", frames=4))


def source(tmp_path: Path, simulator=None) -> SimulatedEvents:
    return SimulatedEvents(simulator or ESIM(), tmp_path / "simulated", workers=1)


def test_the_file_holds_what_the_simulator_makes(tmp_path: Path, recording: Recording) -> None:
    esim = source(tmp_path)
    esim.simulate(recording)
    stored = Events.load(esim.path(recording))
    frames = np.stack([recording.read_frame(index) for index in range(4)])
    expected = ESIM().simulate(frames, recording.frame_times_us, recording.name)
    for name in "txyp":
        np.testing.assert_array_equal(getattr(stored, name), getattr(expected, name))
    assert (stored.height, stored.width) == (recording.height, recording.width)


def test_the_manifest_says_what_the_stream_is(tmp_path: Path, recording: Recording) -> None:
    esim = source(tmp_path)
    esim.simulate(recording)
    manifest = read_json(esim.path(recording).parents[2] / "manifest.json")
    assert manifest["parameters"] == ESIM().parameters()
    assert manifest["simulator"] == "esim"
    assert manifest["events"] == len(Events.load(esim.path(recording)))


def test_a_stream_is_reused_until_its_frames_change(
    tmp_path: Path, recording: Recording, make_recording
) -> None:
    esim = source(tmp_path)
    esim.prepare([recording])
    stamp = esim.path(recording).stat().st_mtime_ns
    esim.prepare([recording])
    assert esim.path(recording).stat().st_mtime_ns == stamp
    later = make_recording(tmp_path / "later" / "street", frames=4, start_us=2_000_000, seed=1)
    esim.prepare([Recording.load(later)])
    assert esim.path(recording).stat().st_mtime_ns != stamp


def test_another_parameter_is_another_stream(tmp_path: Path, recording: Recording) -> None:
    first, second = (source(tmp_path, ESIM(threshold_on_log=threshold)) for threshold in (0.2, 0.3))
    assert first.label != second.label
    assert first.path(recording) != second.path(recording)
    assert source(tmp_path, replace(V2E(), seed=1)).label != source(tmp_path, V2E()).label


def test_a_stream_without_manifest_is_simulated_again(tmp_path: Path, recording: Recording) -> None:
    esim = source(tmp_path)
    esim.simulate(recording)
    (esim.path(recording).parents[2] / "manifest.json").unlink()
    assert not esim._is_current(recording)


def test_an_interrupted_stream_leaves_no_file(tmp_path: Path, recording: Recording) -> None:
    recording.frame_paths[-1].write_bytes(b"no image")
    esim = source(tmp_path)
    with pytest.raises(ValueError, match="readable image"):
        esim.simulate(recording)
    assert not list((tmp_path / "simulated").rglob("*.h5"))
    assert not list((tmp_path / "simulated").rglob("manifest.json"))


def test_nothing_is_simulated_where_frames_are_missing(
    tmp_path: Path, recording: Recording
) -> None:
    blind = replace(recording, name="blind", frame_paths=())
    with pytest.raises(
        ValueError, match=r"frames of blind to simulate from, got none; set data\.root"
    ):
        source(tmp_path).prepare([recording, blind])
    assert not (tmp_path / "simulated").exists()


def test_recorded_events_are_their_own_file(recording: Recording) -> None:
    real = RecordedEvents()
    real.prepare([recording])
    assert real.path(recording) == recording.events_path
    assert (real.name, real.label) == ("real", "real")


def test_a_frame_that_keeps_name_and_size_is_simulated_anew(
    tmp_path: Path, recording: Recording
) -> None:
    esim = source(tmp_path)
    esim.prepare([recording])
    before = esim.path(recording).read_bytes()
    content = recording.frame_paths[1].read_bytes()
    frames = [path.read_bytes() for path in recording.frame_paths]
    recording.frame_paths[1].write_bytes(frames[2] + b"\0" * (len(content) - len(frames[2])))
    esim.prepare([recording])
    assert esim.path(recording).read_bytes() != before


def test_a_foreign_file_in_the_place_of_a_stream_is_not_taken_for_it(
    tmp_path: Path, recording: Recording
) -> None:
    esim = source(tmp_path)
    esim.prepare([recording])
    before = Events.load(esim.path(recording))
    Events.empty(recording.height, recording.width).save(esim.path(recording))
    esim.prepare([recording])
    assert len(Events.load(esim.path(recording))) == len(before) > 0


def test_two_that_want_one_stream_both_get_it_and_one_works(
    tmp_path: Path, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []

    def counted(work, jobs, workers):
        made.extend(jobs)
        return map(work, jobs)

    monkeypatch.setattr("eqs.data.simulated.side_by_side", counted)
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda _: source(tmp_path).prepare([recording]), range(2)))
    assert len(made) == 1


def test_who_stops_listening_stops_the_work(tmp_path: Path) -> None:
    started = time.monotonic()
    results = side_by_side(time.sleep, [0.0, *[60.0] * 4], 2)
    next(results)
    with pytest.raises(KeyboardInterrupt):
        results.throw(KeyboardInterrupt)
    assert time.monotonic() - started < 30
