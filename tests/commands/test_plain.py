"""Verbs with a command line of their own."""

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
