"""Streams that are made before several trainings share them."""

from pathlib import Path

from hydra import compose, initialize_config_dir

from eqs.events import EventReader
from eqs.pipelines.prepare import prepare
from eqs.pipelines.resolvers import register_resolvers

CONFIGS = Path(__file__).parents[2] / "eqs/configs"


def test_every_simulator_s_stream_is_made_once(make_recording, tmp_path):
    make_recording(tmp_path / "data" / "one")
    given = [
        "data=recordings",
        f"data.root={tmp_path / 'data'}",
        *(f"paths.{key}={tmp_path / key}" for key in ("simulated", "results", "runs")),
    ]
    register_resolvers()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("prepare", given)
    prepare(cfg)
    streams = sorted((tmp_path / "simulated" / "recordings").glob("*/one/events/left/events.h5"))
    assert [path.parents[3].name.partition("-")[0] for path in streams] == [
        "esim",
        "pix2nvs",
        "v2e",
    ]
    for path in streams:
        with EventReader(path) as reader:
            assert reader.span_us == (1_000_000, 1_250_000)  # from the first frame to the last
            assert len(reader) > 0
    before = [path.stat().st_mtime_ns for path in streams]
    prepare(cfg)
    assert [path.stat().st_mtime_ns for path in streams] == before
