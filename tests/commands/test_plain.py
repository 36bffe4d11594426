"""Verbs with a command line of their own."""

import numpy as np
import pytest
from omegaconf import OmegaConf
from PIL import Image

from eqs.commands.compare import main as compare
from eqs.commands.compare import settings
from eqs.commands.view import main as view
from eqs.commands.watch import main as watch
from eqs.pipelines.runs import Run


@pytest.fixture
def file(make_events, tmp_path):
    """A second of events."""
    make_events(20_000, 24, 32).save(tmp_path / "events.h5")
    return tmp_path / "events.h5"


def test_a_film_has_the_pictures_and_the_size_asked_for(file, capsys):
    view(
        [str(file), "--seconds", "0.5", "--rate", "20", "--slower", "2", "--zoom", "3"], "eqs view"
    )
    out = file.with_suffix(".gif")
    assert capsys.readouterr().out == f"{out}\n"
    with Image.open(out) as film:
        assert film.size == (96, 72)
        # GIF joins pictures that are equal; those of random events are not.
        assert film.n_frames == round(0.5 * 2 * 20)


def test_frames_stand_above_the_events_of_their_instants(make_events, tmp_path, capsys):
    events = make_events(500, 4, 6)
    span = int(events.t[-1] - events.t[0])
    folder = tmp_path / "frames"
    folder.mkdir()
    for number, light in enumerate((0.0, 0.214, 1.0)):  # linear light, white is 8
        np.save(folder / f"{number}.npy", np.full((4, 6), 8 * light, np.float32))
    events.save(tmp_path / "events.h5")
    first = int(events.t[0])
    times = (first, first + span // 2, first + 4_000_000)
    (folder / "timestamps.txt").write_text("".join(f"{t}\n" for t in times))
    given = [str(tmp_path / "events.h5"), str(tmp_path / "strip.png"), "--frames", str(folder)]
    several = ["--white", "8", "--window-ms", "1", "--rate", str(3e6 / span)]
    view([*given, *several], "eqs view")
    strip = np.asarray(Image.open(tmp_path / "strip.png"))
    assert strip.shape == (8, 6 * 3 + 4 * 2, 3)
    # sRGB of 0.214 is a half; the frame that comes after the events is not shown.
    assert [int(strip[1, x, 0]) for x in (2, 12, 22)] == [0, 127, 127]
    np.save(folder / "0.npy", np.zeros((4, 7), np.float32))
    with pytest.raises(SystemExit, match="Expected"):
        view([*given, *several], "eqs view")


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["gone.h5"], "Expected an event file at gone.h5"),
        (["EVENTS", "film.avi"], "Expected a name that ends in .gif, .mp4, .png"),
        (["EVENTS", "--height", "99"], "Expected a sensor with height 99, got 24"),
    ],
)
def test_a_film_that_cannot_be_made_ends_in_a_sentence(file, arguments, wanted):
    given = [str(file) if each == "EVENTS" else each for each in arguments]
    with pytest.raises(SystemExit) as stop:
        view(given, "eqs view")
    assert wanted in str(stop.value)


def test_unfinished_trainings_are_named(tmp_path):
    run = Run(tmp_path / "begun")
    config = {
        "model": {"size": "tiny"},
        "recipe": {"epochs": 2},
        "task": {"optimizer": {"lr": 0.1}},
    }
    run.save_config(OmegaConf.create(config), {})
    assert settings(run) == {"model.size": "tiny", "recipe.epochs": 2, "task.optimizer.lr": 0.1}
    for command, arguments in ((compare, []), (watch, [str(tmp_path), str(tmp_path / "a.gif")])):
        with pytest.raises(SystemExit, match=r"Expected (a )?finished training"):
            command([str(run.folder), *arguments], "eqs")
