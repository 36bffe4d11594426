"""The verbs of `eqs` do what their scripts do."""

import runpy
import subprocess
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest

from eqs.commands import main, run
from eqs.commands.configured import CONFIGURED, with_files, with_flags
from eqs.commands.dispatch import PLAIN

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("verb", [*CONFIGURED, *PLAIN])
def test_every_verb_has_a_script_of_its_own(verb, monkeypatch, capsys):
    name = f"{verb.replace('-', '_')}.py"
    script = ROOT / name if (ROOT / name).exists() else ROOT / "scripts" / name
    monkeypatch.setattr("sys.argv", [str(script), "--help"])
    with suppress(SystemExit):  # argparse ends this way
        runpy.run_path(str(script), run_name="__main__")
    by_script = capsys.readouterr().out
    monkeypatch.setattr("sys.argv", ["eqs", verb, "--help"])
    with suppress(SystemExit):
        main()
    by_verb = capsys.readouterr().out
    assert by_verb.split()[-20:] == by_script.split()[-20:]
    assert len(by_verb) > 200


@pytest.mark.parametrize("verb", CONFIGURED)
def test_a_verb_names_a_pipeline_that_exists(verb):
    command = CONFIGURED[verb]
    assert callable(getattr(import_module(f"eqs.pipelines.{command.module}"), command.pipeline))


def test_a_mistyped_verb_is_answered_with_the_nearest(monkeypatch):
    monkeypatch.setattr("sys.argv", ["eqs", "tran"])
    with pytest.raises(SystemExit, match=r"Expected one of train, .*, got tran; type eqs train"):
        main()


def test_flags_and_files_become_keys():
    assert with_flags(["a=1", "--eqs", "--sanity"]) == ["a=1", "score=true", "sanity=true"]
    # Hydra reads nothing between keys and what follows its own flags.
    assert with_flags(["--eqs", "-m", "a=1,2"]) == ["-m", "a=1,2", "score=true"]
    given = ["--config-dir", "my", "one.h5", "two.h5"]
    assert with_files(given) == [*given[:2], "simulated=one.h5", "real=two.h5"]
    given = ["-m", "one.h5", "height=3", "two.h5", "three"]
    assert with_files(given) == ["-m", "simulated=one.h5", "height=3", "real=two.h5", "three"]


def test_the_pipeline_sees_what_was_typed(monkeypatch, tmp_path):
    """Lightning's further processes type the command again, so it must be the whole one."""
    seen = []
    monkeypatch.setattr(
        "eqs.pipelines.prepare.prepare", lambda cfg: seen.append((cfg.seed, list(sys.argv)))
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["eqs", "prepare", "seed=3"])
    main()
    assert seen == [(3, ["eqs", "prepare", "seed=3"])]
    assert sys.argv == ["eqs", "prepare", "seed=3"]
    assert [path.name for path in tmp_path.iterdir()] == ["outputs"]
    assert [path.name for path in (tmp_path / "outputs").iterdir()] == ["prepare"]
    run("prepare", ["seed=4"])
    assert seen[-1][0] == 4


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["train", "epochs=3"], "got epochs; set recipe.epochs"),
        (["train", "threshold_on_log=0.3"], "got threshold_on_log; set sim.threshold_on_log"),
        (["train", "preset=paper"], "got preset; set sim=pecs/paper, sim=v2e/paper"),
        (["train", "sim=v2e/papre"], "Could not find 'sim/v2e/papre'"),
        (
            ["evaluate", "threshold_on_log=0.3"],
            "set simulators.esim.threshold_on_log, simulators.v2e.threshold_on_log",
        ),
    ],
)
def test_a_mistake_is_answered_before_anything_heavy_is_loaded(arguments, wanted, tmp_path):
    code = (
        "import atexit, sys, eqs.commands; "
        "atexit.register(lambda: print('torch' in sys.modules)); "
        f"sys.argv[1:] = {arguments!r}; eqs.commands.main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 1
    assert wanted in done.stderr
    assert done.stdout == "False\n"


def test_ctrl_c_ends_in_a_sentence(monkeypatch, capsys, tmp_path):
    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("eqs.pipelines.prepare.prepare", interrupted)
    monkeypatch.setattr("sys.argv", ["eqs", "prepare"])
    with pytest.raises(SystemExit) as stopped:
        run("prepare", [])
    assert stopped.value.code == 130
    said = capsys.readouterr().err
    assert said.strip().splitlines()[-1] == "interrupted; type the same command again"
    assert "Traceback" not in said
