"""Every command has a page that is complete, short and there at once."""

import subprocess
import sys

import pytest

from eqs.commands.configured import CONFIGS, CONFIGURED
from eqs.commands.help_page import configured_page, first_comment, groups, keys, options

WIDEST, LONGEST = 104, 150


@pytest.mark.parametrize("verb", CONFIGURED)
def test_a_page_says_what_a_command_is_for_and_how_it_is_typed(verb):
    lines = configured_page(verb, f"eqs {verb}").splitlines()
    assert lines[0].endswith(".")
    examples = [line for line in lines[:8] if line.startswith(f"  eqs {verb}")]
    assert len(examples) == 5
    assert max(map(len, lines)) <= WIDEST
    assert len(lines) <= LONGEST


@pytest.mark.parametrize("verb", CONFIGURED)
def test_every_group_option_and_value_has_a_line(verb):
    page = configured_page(verb, verb).splitlines()
    found = groups(verb)
    assert len({group.name for group in found}) == len(found)
    assert len(found) >= 2 or verb == "trial"  # whose parts all stand in its own file
    for group in found:
        assert f"{group.name}={group.default}   {group.line}" in page
        for name, path in options(group.name).items():
            said = first_comment(path)
            assert said.endswith("."), f"{group.name}={name}"
            assert any(line.split() == [name, *said.split()] for line in page)
    for key, default, comment in keys(verb):
        assert f"  {key}={default}" in page
        assert len(comment) > 10


def test_nothing_that_users_do_not_choose_is_shown():
    page = configured_page("train", "train")
    for hidden in ("base/", "paths", "hydra:", "datamodule", "_target_"):
        assert hidden not in page
    assert not list((CONFIGS / "sim").glob("_*"))


@pytest.mark.parametrize("arguments", [["train", "--help"], ["evaluate", "-h"], ["--help"], []])
def test_a_page_needs_none_of_the_libraries(arguments):
    code = (
        "import sys, eqs.commands; sys.argv[1:] = " + repr(arguments) + "; eqs.commands.main(); "
        "sys.exit(bool({'hydra', 'omegaconf', 'torch', 'numpy', 'lightning'} & {*sys.modules}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "train" in done.stdout
