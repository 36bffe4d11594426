"""The reading benchmark reads what it drew, and its recording has what it says."""

import pytest

from eqs.benchmarks import reading
from eqs.benchmarks.reading import Job, OneRecording, draw, fill, streamed, windows_per_second
from eqs.events import EventReader


@pytest.fixture
def job(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "PER_WINDOW", 2_000)
    monkeypatch.setattr(reading, "BATCHES", 3)
    draw(tmp_path / "events.h5", 12, 64, 48)
    return Job(
        events=tmp_path / "events.h5", size=(64, 48), windows=12, cache=tmp_path / "kept", workers=0
    )


def test_every_window_has_its_events_and_its_histogram(job):
    with EventReader(job.events) as events:
        counts = [len(events.window(50_000 * k, 50_000 * (k + 1))) for k in range(12)]
    assert counts == [2_000] * 12
    fill(job)
    assert len(list(job.cache.rglob("*.h5"))) == 12 == len(OneRecording(job).recording.tracks) - 1


def test_windows_come_from_the_cache_as_from_the_events(job):
    assert windows_per_second(job) > 0
    rate, early, late = streamed(job)
    assert rate > 0
    assert late >= early > 0
    with pytest.raises(ValueError, match=r"at least 10000 events, .*set --events"):
        reading.print_table(9_999, 64, 48)
