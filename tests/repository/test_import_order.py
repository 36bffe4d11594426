"""The rooms of the package: which imports which, exactly, and that no circle is among modules."""

import subprocess
import sys
from pathlib import Path

import pytest
from import_graph import circle, graph, imports, main, room

# A room imports rooms that stand above it here, and these alone: whoever adds an arrow says so.
ROOMS = {
    "eqs": "",
    "eqs.names": "",
    "eqs.clock": "",
    "eqs.extras": "",
    "eqs.files": "",
    "eqs.processors": "",
    "eqs.kernels": "",
    "eqs.content": "processors",
    "eqs.events": "clock extras files kernels",
    "eqs.frames.networks": "files",
    "eqs.frames": "clock extras files frames.networks",
    "eqs.representations": "events kernels",
    "eqs.drawing": "events extras files names",
    "eqs.simulators.streaming": "events frames kernels processors",
    "eqs.simulators.pixel": "frames kernels processors simulators.streaming",
    "eqs.simulators.pixel.filtered": "frames kernels simulators.pixel simulators.streaming",
    "eqs.simulators": "events frames kernels simulators.pixel simulators.pixel.filtered "
    "simulators.streaming simulators.learned",
    "eqs.simulators.learned": "files frames kernels models simulators simulators.pixel "
    "simulators.streaming",
    "eqs.scenes": "events files frames processors kernels representations",
    "eqs.scenes.traced": "extras frames scenes",
    "eqs.data": "content events files frames processors simulators",
    "eqs.models": "kernels",
    "eqs.metrics.baselines": "events metrics",
    "eqs.metrics": "events extras files kernels models representations",
    "eqs.pair": "events files metrics metrics.baselines",
    "eqs.trial": "events files metrics scenes",
    "eqs.training": "content data drawing events files frames metrics models representations "
    "simulators.learned",
    "eqs.study": "drawing files names",
    "eqs.pipelines": "content data drawing events extras files frames metrics metrics.baselines "
    "models names pair processors simulators simulators.learned study training trial",
    "eqs.benchmarks": "data events extras frames metrics models representations scenes simulators "
    "simulators.learned training",
    "eqs.commands": "benchmarks data drawing events extras files frames frames.networks pipelines",
    "eqs.__main__": "commands",
}
# The published models: each builds on the simulator, its parts and the stream, and on no other.
MODELS = ("dvs_voltmeter", "esim", "icns", "improved_esim", "prophesee", "v2e")
MODEL = "frames kernels simulators simulators.pixel simulators.streaming"


def expected() -> dict[str, set[str]]:
    """Every room with those that it may import."""
    lines = {**ROOMS, **{f"eqs.simulators.{model}": MODEL for model in MODELS}}
    lines["eqs.simulators"] += "".join(f" simulators.{model}" for model in MODELS)
    return {name: {f"eqs.{each}" for each in line.split()} for name, line in lines.items()}


def rooms() -> dict[str, set[str]]:
    """Every room with those that it imports, `eqs` itself (its version) left out."""
    found: dict[str, set[str]] = {}
    for name, imported in graph().items():
        found.setdefault(room(name), set()).update(room(each) for each in imported)
    return {name: others - {name, "eqs"} for name, others in found.items()}


def test_the_rooms_are_those_that_are_written_down() -> None:
    assert rooms().keys() == expected().keys()


@pytest.mark.parametrize("name", expected())
def test_a_room_imports_what_is_written_down(name: str) -> None:
    assert rooms()[name] == expected()[name]


def test_no_module_needs_one_that_needs_it() -> None:
    assert circle(graph(at_once=True)) == []


def test_arrows_and_circles_are_found() -> None:
    known = {"eqs.a", "eqs.a.b", "eqs.c"}
    source = (
        "from eqs.a import b\nif TYPE_CHECKING:\n    import eqs.c\n"
        "def f():\n    from eqs.c import thing\n"
    )
    assert imports(source, known) == {"eqs.a.b", "eqs.c"}
    assert imports(source, known, at_once=True) == {"eqs.a.b"}
    assert set(circle({"eqs.a": {"eqs.c"}, "eqs.c": {"eqs.a"}})) == {"eqs.a", "eqs.c"}
    # Who imports a part of a package from outside needs the whole of it.
    assert circle({"eqs.a": {"eqs.a.b"}, "eqs.a.b": {"eqs.c"}, "eqs.c": {"eqs.a.b"}})


def test_the_command_prints_the_graph(capsys: pytest.CaptureFixture[str]) -> None:
    main()
    printed = capsys.readouterr().out
    assert "no circles" in printed
    assert all(f"{name} " in printed for name in ROOMS)


@pytest.mark.parametrize(
    ("module", "unwanted"),
    [
        ("eqs.simulators", {"torch", "pandas", "matplotlib"}),
        ("eqs.data", {"torch", "pandas", "matplotlib"}),
        ("eqs.drawing", {"torch", "pandas", "scipy", "jinja2", "lightning"}),
        ("eqs.metrics", {"lightning", "pandas", "jinja2", "faster_coco_eval"}),
        ("eqs.study", {"torch", "lightning"}),
    ],
)
def test_what_a_room_does_not_load(module: str, unwanted: set[str]) -> None:
    code = f"import sys, {module}; print(*sorted({unwanted!r} & {{*sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_the_tree_in_contributing_is_true() -> None:
    text = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text()
    for name in expected():
        folder = name.replace(".", "/")
        if (Path(__file__).parents[2] / folder).is_dir() and name != "eqs":
            assert f"{folder.rpartition('/')[2]}/" in text, name
