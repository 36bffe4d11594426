"""Mixed events: which recordings are trained on, through which streams, under which name."""

from collections import Counter
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from hydra.errors import InstantiationException

import eqs
from eqs.data import MixedEvents, RecordedEvents, Recording, SimulatedEvents
from eqs.data.mixed import chosen
from eqs.pipelines.build import event_source
from eqs.pipelines.resolvers import register_resolvers
from eqs.simulators import ESIM, V2E

CONFIGS = Path(eqs.__file__).parent / "configs"


@pytest.fixture
def recordings(tmp_path: Path, make_recording) -> list[Recording]:
    return [Recording.load(make_recording(tmp_path / f"r{at}", frames=2)) for at in range(10)]


def mixed(tmp_path: Path, esim: float, real: float, **changed) -> MixedEvents:
    sources = {"esim": SimulatedEvents(ESIM(), tmp_path, workers=1), "real": RecordedEvents()}
    settings = {"shares": {"esim": esim, "real": real}, "evaluated_on": "esim", "seed": 0}
    return MixedEvents(sources=sources, **{**settings, **changed})


def composed(*overrides: str, command: str = "train") -> MixedEvents:
    register_resolvers()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose(command, overrides=["sim=mix", *overrides])
    source = event_source(cfg.sim, cfg)
    assert isinstance(source, MixedEvents)
    return source


def test_a_share_takes_so_many_whole_recordings_in_their_order(recordings) -> None:
    counts = {0.0: 0, 0.01: 1, 0.1: 1, 0.24: 2, 0.26: 3, 0.5: 5, 1.0: 10}
    for share, count in counts.items():
        found = chosen(recordings, share, 0, "real")
        assert len(found) == count
        assert found == [each for each in recordings if each in found]


def test_the_choice_follows_from_seed_stream_and_names_alone(recordings) -> None:
    def names(*, seed: int = 0, stream: str = "real", of=recordings) -> set[str]:
        return {each.name for each in chosen(of, 0.5, seed, stream)}

    assert names() == names() == names(of=recordings[::-1])
    assert len({frozenset(names(seed=seed)) for seed in range(10)}) > 5
    assert names() != names(stream="esim")


def test_a_smaller_share_is_among_a_larger_one_whatever_the_seed(recordings) -> None:
    for seed in range(5):
        smaller: set[Recording] = set()
        for percent in range(0, 101, 5):
            larger = set(chosen(recordings, percent / 100, seed, "real"))
            assert smaller <= larger
            smaller = larger


def test_no_recording_is_preferred(recordings) -> None:
    drawn = Counter(chosen(recordings, 0.1, seed, "real")[0].name for seed in range(1000))
    assert len(drawn) == 10
    assert max(drawn.values()) < 140  # four standard deviations above 100


def test_the_union_holds_a_recording_once_per_stream(tmp_path: Path, recordings) -> None:
    source = mixed(tmp_path, 1.0, 0.3)
    files = source.training_files(recordings)
    esim = source.sources["esim"]
    assert files[:10] == [(each, esim.path(each)) for each in recordings]
    assert files[10:] == [(each, each.events_path) for each in chosen(recordings, 0.3, 0, "real")]
    assert len(files) == 13


def test_other_splits_see_one_stream(tmp_path: Path, recordings) -> None:
    assert mixed(tmp_path, 0.5, 1.0).path(recordings[0]).parents[3].name.startswith("esim-")
    evaluated = mixed(tmp_path, 0.5, 1.0, evaluated_on="real")
    assert evaluated.path(recordings[0]) == recordings[0].events_path


def test_streams_that_are_not_seen_are_not_made(tmp_path: Path, recordings) -> None:
    mixed(tmp_path / "s", 0.0, 1.0, evaluated_on="real").prepare(recordings)
    assert not (tmp_path / "s").exists()
    source = mixed(tmp_path / "s", 0.0, 1.0)
    source.prepare(recordings[:2])
    assert source.path(recordings[1]).is_file()


def test_a_mix_is_called_what_it_is(tmp_path: Path) -> None:
    assert mixed(tmp_path, 1.0, 0.1).name == "mix_esim100_real10"
    assert mixed(tmp_path, 0.0, 0.07).name == "mix_real7"
    assert mixed(tmp_path, 0.125, 0.0).name == "mix_esim12.5"
    assert mixed(tmp_path, 1.0, 0.1).parts == {"esim": 1.0, "real": 0.1}
    sources = {
        "mild": SimulatedEvents(ESIM(), tmp_path),
        "strong": SimulatedEvents(ESIM(threshold_on_log=0.3), tmp_path),
        "v2e": SimulatedEvents(V2E(), tmp_path),
    }
    several = MixedEvents(
        sources=sources, shares={"mild": 1, "strong": 0.5, "v2e": 1}, evaluated_on="mild", seed=0
    )
    assert several.name == "mix_esim100_esim50_v2e100"
    assert several.parts == {sources["mild"].label: 1, sources["strong"].label: 0.5, "v2e": 1}


def test_the_label_differs_whenever_the_events_could(tmp_path: Path) -> None:
    kinds = [
        mixed(tmp_path, 1.0, 0.1),
        mixed(tmp_path, 1.0, 0.1, seed=1),
        mixed(tmp_path, 1.0, 0.1, evaluated_on="real"),
        mixed(tmp_path, 1.0, 1.0),
        mixed(tmp_path, 1.0, 0.101),
        mixed(tmp_path, 0.1, 1.0),
    ]
    assert len({each.label for each in kinds}) == len(kinds)
    assert mixed(tmp_path, 1.0, 1.0, seed=1).label == mixed(tmp_path, 1.0, 1.0).label
    assert all(each.label.startswith(f"{each.name}-") for each in kinds)


def test_shares_and_simulators_are_chosen_on_the_command_line() -> None:
    assert composed().parts == {"esim": 1.0, "real": 1.0}
    tenth = composed("sim.streams.real.share=0.1", "seed=3")
    assert (tenth.name, tenth.evaluated_on, tenth.seed) == ("mix_esim100_real10", "simulated", 3)
    other = composed("sim@sim.streams.simulated.events=v2e/paper", "sim.streams.real.share=0.1")
    (simulated, _) = other.sources.values()
    assert isinstance(simulated, SimulatedEvents)
    assert simulated.simulator == V2E(
        threshold_on_log=0.3, threshold_off_log=0.3, threshold_sigma_log=0.03
    )
    three = composed("+sim@sim.streams.more.events=pix2nvs", "+sim.streams.more.share=0.5")
    assert three.parts == {"esim": 1.0, "real": 1.0, "pix2nvs": 0.5}
    alone = composed("sim.streams.simulated.share=0", "sim.streams.real.share=0.25")
    assert (alone.name, alone.evaluated_on) == ("mix_real25", "real")


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["sim.streams.real.share=2"], r"share in \[0, 1\], got 2; set sim.streams.real.share"),
        (["sim.streams.real.share=-0.1"], r"share in \[0, 1\], got -0.1; set sim.streams.real.sha"),
        (["sim.streams.real.share=half"], r"in \[0, 1\], got 'half'; set sim.streams.real.share"),
        (["sim.streams.real.share=true"], r"in \[0, 1\], got True; set sim.streams.real.share"),
        (["sim.evaluated_on=rael"], "of the streams simulated, real, got 'rael'; set sim.eval"),
        (["+sim.streams.new.share=1"], r"add \+sim@sim.streams.new.events=NAME"),
        (
            ["sim.streams.real.share=0", "sim.streams.simulated.share=0"],
            "stream with a share, got none; set sim.streams.simulated.share, sim.streams.real.sha",
        ),
        (["sim@sim.streams.simulated.events=mix"], "Expected a simulator, given or .* got a Mix"),
    ],
)
def test_a_wrong_mix_is_refused_by_its_key(overrides: list[str], said: str) -> None:
    with pytest.raises((InstantiationException, ValueError), match=said):
        composed(*overrides)
