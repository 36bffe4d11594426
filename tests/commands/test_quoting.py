"""A path arrives in the configuration letter by letter, whatever letters it has."""

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hypothesis import given
from hypothesis import strategies as st

from eqs.commands.configured import with_files
from eqs.commands.quoting import quoted, with_quoted_path

NAMES = [
    "a (copy).h5", "a,b.h5", "a=b.h5", "zürich events.h5", "it's.h5", 'say "so".h5', "[x].h5",
    "{x}.h5", "a:b, c=(d).h5", "back\\slash.h5", "日本.h5",
]  # fmt: skip


def read(argument):
    return OverridesParser.create().parse_override(argument).value()


@pytest.mark.parametrize("name", NAMES)
def test_a_file_that_is_there(tmp_path, monkeypatch, name):
    (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    path = f"{tmp_path}/{name}"
    assert read(with_quoted_path(f"simulated={path}")) == path
    assert [read(with_quoted_path(each)) for each in with_files([path, path])] == [path, path]
    assert with_files([name])[0] == f"simulated={name}"


@pytest.mark.parametrize("name", ["[x].h5", "{x}.h5", "$x.h5", "[a, b].h5"])
def test_a_file_beside(tmp_path, monkeypatch, name):
    (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    assert read(with_quoted_path(f"out={name}")) == name


@pytest.mark.parametrize("name", NAMES)
def test_a_file_that_is_to_come(tmp_path, name):
    assert read(with_quoted_path(f"out={tmp_path}/{name}")) == f"{tmp_path}/{name}"


@pytest.mark.parametrize(
    "argument",
    ["sim=esim,v2e", "sim=v2e/paper,esim", "jobs=2", "a.b=[1,2]", "x={a: 1}", "-m", "y='a,b'",
     "data.root=${paths.datasets}/x", "z=choice(1,2)", "out="],
)  # fmt: skip
def test_what_is_no_path_is_hydras_to_read(argument):
    assert with_quoted_path(argument) == argument


@given(st.text(st.characters(exclude_categories=("Cc", "Cs")), min_size=1))
def test_every_text_comes_through_quotes(text):
    if "${" not in text:
        assert read(f"key={quoted(text)}") == text
