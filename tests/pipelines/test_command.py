"""Whatever a newcomer mistypes ends in one sentence that names a key."""

import logging
from collections.abc import Callable
from pathlib import Path
from zipfile import BadZipFile

import pytest
from hydra import compose, initialize_config_dir
from hydra.errors import ConfigCompositionException
from hydra.utils import instantiate
from omegaconf import DictConfig
from PIL.Image import DecompressionBombError
from yaml import YAMLError

import eqs
from eqs.pipelines.command import explained
from eqs.pipelines.keys import in_this_command, keys_explained
from eqs.pipelines.resolvers import register_resolvers

CONFIGS = Path(eqs.__file__).parent / "configs"


def composed(*overrides: str) -> DictConfig:
    register_resolvers()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose("train", overrides=list(overrides))


@pytest.fixture
def said(caplog: pytest.LogCaptureFixture) -> Callable[..., str]:
    """The sentence in which a command ends."""

    def run(work: Callable[[DictConfig], object], *overrides: str) -> str:
        with caplog.at_level(logging.ERROR), pytest.raises(SystemExit) as stopped:
            explained(work)(composed(*overrides))
        assert stopped.value.code == 1
        (record,) = caplog.records
        assert "\n" not in record.message
        return record.message

    return run


@pytest.mark.parametrize(
    ("override", "wanted"),
    [
        ("sim.threshold_on_log=high", "threshold_on_log above 0, got 'high'; set sim.threshold_on"),
        ("sim.threshold_off_log=null", "threshold_off_log above 0, got None; set sim.threshold_of"),
        ("sim.refractory_us=-1", "refractory_us of 0 or more, got -1; set sim.refractory_us"),
        ("+sim.foo=1", "unexpected keyword argument 'foo'"),
    ],
)
def test_bad_simulator_settings(said: Callable[..., str], override: str, wanted: str) -> None:
    message = said(lambda cfg: instantiate(cfg.sim), override)
    assert wanted in message
    assert "config key sim" in message


@pytest.mark.parametrize("seed", ["-1", "abc", "1.5", "null", str(2**32)])
def test_a_seed_that_is_none(said: Callable[..., str], seed: str) -> None:
    message = said(lambda cfg: None, f"seed={seed}")
    assert message.startswith("Expected seed to be a whole number from 0 to 4294967295, got")
    assert message.endswith("set seed")


def test_a_value_of_the_wrong_kind_names_its_place(said: Callable[..., str]) -> None:
    message = said(lambda cfg: instantiate(cfg.data), "data.generator.frames=many")
    assert message.startswith("Expected")
    assert "(config key data.generator)" in message


def test_a_value_that_must_be_given(said: Callable[..., str]) -> None:
    message = said(lambda cfg: cfg.data.root, "data=dsec")
    assert message == "Expected a value for data.root, got none; set data.root=..."


def test_a_place_that_cannot_be_written_names_its_key(
    said: Callable[..., str], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    message = said(
        lambda cfg: Path(cfg.paths.runs, "dsec_mini").mkdir(parents=True),
        f"paths.runs={tmp_path / 'file'}",
    )
    assert message.startswith(f"Expected to read and write {tmp_path / 'file'}")
    assert message.endswith("set paths.runs")


@pytest.mark.parametrize(
    ("error", "wanted"),
    [
        (MemoryError(), "Expected memory enough, got none left (it does not say for what); set "),
        (MemoryError("4 GiB for t"), "Expected memory enough, got none left (4 GiB for t); set "),
        (EOFError(), "Expected files that are whole, got: it ends too early; write or fetch"),
        (BadZipFile("File is not a zip file"), "Expected files that are whole, got: File is not"),
        (YAMLError("a tab\nin line 3"), "Expected files that are whole, got: a tab; write"),
        (DecompressionBombError("300000000 pixels"), "Expected files that are whole, got: 3000"),
        (ImportError("libfoo.so.3"), "Expected the packages of this command to load, got: libfoo"),
    ],
)
def test_what_files_and_machines_cause_is_one_sentence(
    said: Callable[..., str], error: Exception, wanted: str
) -> None:
    def failing(cfg: DictConfig) -> None:
        raise error

    message = said(failing)
    assert message.startswith(wanted)
    assert "\n" not in message


def test_a_mistake_of_ours_keeps_its_traceback() -> None:
    def broken(cfg: DictConfig) -> None:
        raise TypeError("ours")

    with pytest.raises(TypeError, match="ours"):
        explained(broken)(composed())


@pytest.mark.parametrize(
    ("override", "wanted"),
    [
        ("sim.treshold_on_log=0.3", "got sim.treshold_on_log; set sim.threshold_on_log, "),
        ("sead=1", "got sead; set seed\n"),
        ("epochs=3", "got epochs; set recipe.epochs\n"),
        ("threshold_on_log=1", "set sim.threshold_on_log\n"),
        ("datamodule.zzz=1", "got datamodule.zzz; set datamodule."),
    ],
)
def test_a_key_that_does_not_exist_names_those_that_do(
    capsys: pytest.CaptureFixture[str], override: str, wanted: str
) -> None:
    def as_hydra_does() -> None:
        try:
            composed(override)
        except ConfigCompositionException:
            raise SystemExit(1)  # noqa: B904 - the mistake is the context, not the cause

    with pytest.raises(SystemExit), keys_explained():
        as_hydra_does()
    message = capsys.readouterr().err
    assert message.startswith("Expected a key that exists, ")
    assert wanted in message
    assert "_target_" not in message


@pytest.mark.parametrize(
    ("advice", "where", "expected"),
    [
        ("set sim.mode", "simulators.v2e", "set simulators.v2e.mode"),
        ("set sim.knee_level", "", "set simulators.v2e.knee_level"),
        ("set sim.nothing or data.root", "", "set sim.nothing or data.root"),
        ("set recipe.epochs", "", "set recipe.epochs"),
    ],
)
def test_advice_names_keys_that_the_command_has(advice: str, where: str, expected: str) -> None:
    register_resolvers()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("evaluate")
    assert in_this_command(f"Expected a, got b; {advice}", cfg, where).endswith(expected)
