"""Light behind display values: the curves, what they cost nothing for, and what simulators see."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from eqs import simulators
from eqs.frames import GreyImage, Light, linear_to_srgb
from eqs.pipelines.resolvers import register_resolvers
from eqs.scenes.camera import tone_curve
from eqs.simulators import ADV2E, ESIM, PECS, DVSPixel, Simulator, VolumeNetwork

KINDS = [
    kind for kind in vars(simulators).values()
    if isinstance(kind, type) and issubclass(kind, Simulator) and "name" in vars(kind)
    and not issubclass(kind, VolumeNetwork)  # whose networks learned what they see
]  # fmt: skip

LIT = (PECS, ADV2E, DVSPixel)  # those that begin with the light


def test_the_curve_undoes_that_of_the_rendered_camera():
    light = np.linspace(0, 1, 1001)
    display = 255 * tone_curve(light)
    assert np.abs(Light().levels(display) / 255 - light).max() < 1e-12


def test_there_and_back_is_the_same_light():
    light = np.linspace(0, 1, 1001)
    assert linear_to_srgb(light) == pytest.approx(tone_curve(light), abs=1e-12)
    assert Light().levels(255 * linear_to_srgb(light)) / 255 == pytest.approx(light, abs=1e-12)


def test_gamma_and_black_level():
    found = Light(curve="gamma22", black_level=51).levels(np.array([0, 51, 153, 255]))
    assert found == pytest.approx([0, 0, 255 * 0.5**2.2, 255])


def test_eight_bits_keep_their_table_and_floats_agree():
    frame = np.random.default_rng(0).integers(0, 256, (6, 8)).astype(np.uint8)
    image = Light().image(frame)
    assert image.codes.dtype == np.uint8
    assert len(image.levels) == 256
    floating = Light().image(frame.astype(np.float32))
    assert image.levels[image.codes] == pytest.approx(floating.levels[floating.codes])


def test_colours_add_their_light():
    frame = np.zeros((1, 3, 3), np.uint8)
    frame[0, 0, 0] = frame[0, 1, 1] = frame[0, 2, 2] = 255
    image = Light(weights="bt709").image(frame)
    assert image.levels[image.codes] == pytest.approx([255 * w for w in (0.2126, 0.7152, 0.0722)])
    grey = np.full((2, 2, 3), 100, np.uint8)
    seen = [Light(weights=name).image(grey) for name in ("luma", "bt709", "photodiode")]
    for other in seen[1:]:
        assert other.levels[other.codes] == pytest.approx(seen[0].levels[seen[0].codes])


@pytest.mark.parametrize("display", [40, 90, 160])
def test_an_edge_of_true_contrast_fires_as_often_as_it_should(display):
    """A quarter more light: floor(ln 1.25 / C) events of ESIM, and fewer on display values."""
    first = 255 * float(tone_curve(np.array(Light().levels(np.array([display]))[0] / 255)))
    second = 255 * float(tone_curve(np.array(1.25 * Light().levels(np.array([display]))[0] / 255)))
    frames = np.array([[[first]], [[second]]], np.float64)
    settings = {"threshold_on_log": 0.02, "threshold_off_log": 0.02, "log_offset": 1e-6}
    settings |= {"refractory_us": 0}
    known = {name: value for name, value in settings.items() if hasattr(ESIM(), name)}
    seen = len(ESIM(light=Light(), **known).simulate(frames, [0, 50_000], white=255))
    plain = len(ESIM(**known).simulate(frames, [0, 50_000], white=255))
    assert seen == math.floor(math.log(1.25) / 0.02)
    assert plain < 0.7 * seen


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_simulator_takes_light_and_says_so(kind):
    generator = np.random.default_rng(1)
    frames = generator.integers(20, 230, (4, 12, 16)).astype(np.uint8)
    times = 20_000 * np.arange(4)
    plain, lit = kind(), kind(light=Light())
    assert ("light" in plain.parameters()) == (kind in LIT)
    plain = replace(plain, light=None)
    assert lit.parameters()["light"] == Light().parameters()
    linear = Light().levels(frames.astype(np.float64))
    found = lit.simulate(frames, times, white=255)
    assert len(found) != len(plain.simulate(frames, times, white=255))
    if lit.interpolation is None:  # between whose frames display values are made
        expected = plain.simulate(linear, times, white=255)
        assert all((getattr(found, n) == getattr(expected, n)).all() for n in "txyp")


def test_wrong_choices_are_named():
    for choice, message in (
        ({"curve": "log"}, r"curve among srgb, gamma22, got 'log'; set light\.curve"),
        ({"weights": "mean"}, r"set light\.weights"),
        ({"black_level": 255.0}, r"set light\.black_level"),
    ):
        with pytest.raises(ValueError, match=message):
            Light(**choice)


@pytest.mark.parametrize("program", ["train", "simulate", "evaluate"])
def test_every_program_offers_light(program):
    register_resolvers()
    with initialize_config_dir(str(_configs()), version_base="1.3"):
        cfg = compose(program, ["light=srgb", "light.weights=bt709"])
    chosen = cfg.simulators.esim if program == "evaluate" else cfg.sim
    assert instantiate(chosen).light == Light(weights="bt709")


def _configs():
    from pathlib import Path

    return Path(simulators.__file__).parents[1] / "configs"


def test_display_values_are_the_default():
    frame = np.arange(12, dtype=np.uint8).reshape(3, 4)
    assert ESIM().light is None
    assert GreyImage.from_frame(frame).levels[7] == 7
