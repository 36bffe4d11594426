"""Streams of another program stand beside those that are simulated here."""

from dataclasses import replace
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir

import eqs
from eqs.data import GivenEvents, GivenStreams, Recording, SimulatedEvents
from eqs.events import EventReader, Events
from eqs.pipelines.build import event_source
from eqs.simulators import ESIM

CONFIGS = Path(eqs.__file__).parent / "configs"


@pytest.fixture
def recording(tmp_path, make_recording) -> Recording:
    return Recording.load(make_recording(tmp_path / "data" / "street", frames=5))


def as_text(events: Events, path: Path) -> None:
    lines = [f"{events.width} {events.height}"]
    rows = zip(*(getattr(events, name).tolist() for name in "txyp"), strict=True)
    lines += [f"{t / 1e6:.6f} {x} {y} {p}" for t, x, y, p in rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines))


def given(tmp_path: Path, name: str = "mine") -> GivenStreams:
    return GivenStreams(GivenEvents(folder=tmp_path / "given", name=name), tmp_path / "simulated")


def test_a_given_stream_is_what_the_same_events_are_here(tmp_path, recording):
    own = SimulatedEvents(ESIM(), tmp_path / "simulated", workers=1)
    own.prepare([recording])
    with EventReader(own.path(recording)) as reader:
        events = reader.read()
    as_text(events, tmp_path / "given" / "street.txt")
    mine = given(tmp_path)
    mine.prepare([recording])
    with EventReader(mine.path(recording)) as reader:
        found = reader.read()
    for name in "txyp":
        assert getattr(found, name).tolist() == getattr(events, name).tolist()
    assert found.span_us == events.span_us  # so windows and scores are the same
    assert mine.name == "mine (given)"
    assert mine.label.startswith("mine-")


def test_a_converted_stream_is_kept_until_its_file_changes(tmp_path, recording, make_events):
    first = make_events(200, stop_us=200_000).shifted(1_000_000)
    first.save(tmp_path / "given" / "street.h5")
    mine = given(tmp_path)
    mine.prepare([recording])
    stamp = mine.path(recording).stat().st_mtime_ns
    mine.prepare([recording])
    assert mine.path(recording).stat().st_mtime_ns == stamp
    make_events(300, stop_us=200_000).shifted(1_000_000).save(tmp_path / "given" / "street.h5")
    again = given(tmp_path)
    again.prepare([recording])
    assert again.label != mine.label
    with EventReader(again.path(recording)) as reader:
        assert len(reader) == 300


@pytest.mark.parametrize("layout", ["street.h5", "street/events/left/events.h5"])
def test_both_layouts_are_found(tmp_path, recording, make_events, layout):
    make_events(200, stop_us=200_000).shifted(1_000_000).save(tmp_path / "given" / layout)
    assert given(tmp_path).given.file(recording) == tmp_path / "given" / layout


def test_what_does_not_fit_is_named(tmp_path, recording, make_events):
    folder, mine = tmp_path / "given", given(tmp_path)
    with pytest.raises(FileNotFoundError, match=r"Expected street with any ending in .*sim.folder"):
        mine.prepare([recording])
    make_events(200, stop_us=200_000).save(folder / "street.h5")
    with pytest.raises(
        ValueError, match=r"clock of the frames, 1000000 to 1200000 us, .*from_first_frame"
    ):
        mine.prepare([recording])
    counted = GivenStreams(replace(mine.given, from_first_frame=True), tmp_path / "simulated")
    counted.prepare([recording])
    with EventReader(counted.path(recording)) as reader:
        assert 1_000_000 <= reader.start_us < reader.stop_us <= 1_200_001
    assert counted.label != mine.label
    make_events(200, height=9, width=9).save(folder / "street.h5")
    with pytest.raises(ValueError, match="sensor with height 24, got 9"):
        mine.prepare([recording])
    Events.empty(recording.height, recording.width).save(folder / "street.h5")
    with pytest.raises(ValueError, match="got none, nor a span"):
        mine.prepare([recording])
    make_events(200).save(folder / "street.hdf5")
    with pytest.raises(ValueError, match=r"one file of street in .*got street.h5, street.hdf5"):
        mine.prepare([recording])
    for name in ("real", "my sim", ""):
        with pytest.raises(ValueError, match=r"set sim\.name"):
            replace(mine.given, name=name)


def test_the_configuration_builds_it(tmp_path):
    chosen = [f"sim.folder={tmp_path}", "sim.name=mine", f"paths.simulated={tmp_path / 'made'}"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("train", overrides=["sim=files", *chosen])
    source = event_source(cfg.sim, cfg)
    assert isinstance(source, GivenStreams)
    assert source.root == tmp_path / "made" / "dsec_mini"
