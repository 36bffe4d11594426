"""The ray tracer: its units, its lens, its noise, and that it shows the painted street."""

import numpy as np
import pytest

from eqs.frames import QUANTUM_EFFICIENCY
from eqs.scenes import recorded_street
from eqs.simulators import ESIM

pytest.importorskip("mitsuba")

from dataclasses import asdict

from eqs.scenes.traced import Lens, TracedStreet
from eqs.scenes.traced.camera import camera_plugin, developed
from eqs.scenes.traced.engine import engine
from eqs.scenes.traced.materials import spectrum

SMALL = {"height": 24, "width": 32, "samples_per_pixel": 4}


def pictured(parts, lens, *, height=12, width=16, samples=16, seed=0):
    """What the camera makes of a scene."""
    mi = engine()
    camera = camera_plugin(height, width, lens, samples)
    scene = {"type": "scene", "integrator": {"type": "path"}, "camera": camera, **parts}
    return developed(np.array(mi.render(mi.load_dict(scene), seed=seed), np.float32))


def glowing(values):
    return {"sky": {"type": "constant", "radiance": spectrum(np.asarray(values, float))}}


def test_a_flat_emitter_gives_its_radiance_times_the_mean_efficiency():
    current = pictured(glowing(np.full(31, 12.5)), Lens())
    assert current.dtype == np.float32
    assert current == pytest.approx(12.5 * np.mean(QUANTUM_EFFICIENCY), rel=0.01)


def test_a_coloured_emitter_counts_by_the_efficiency():
    colour = np.linspace(0.2, 3.0, 31)
    current = pictured(glowing(colour), Lens(), samples=256).mean()
    assert current == pytest.approx(np.mean(colour * QUANTUM_EFFICIENCY), rel=0.01)


def blur(lens):
    """Standard deviation in pixels of the fade of a bright edge 4 m away."""
    edge = {
        "type": "rectangle",  # it faces the camera; its right edge is in the middle
        "to_world": engine()
        .ScalarTransform4f()
        .translate([10, 0, 4])
        .scale(10)
        .rotate([1, 0, 0], 180),
        "light": {"type": "area", "radiance": spectrum(np.ones(31))},
    }
    share = pictured({"edge": edge}, lens, height=32, width=128, samples=256).mean(0)
    share /= share.max()
    assert share[:30].min() > 0.98
    assert share[-30:].max() < 0.02
    spread, at = -np.diff(share), np.arange(1, 128)
    return np.sqrt((spread * (at - 64) ** 2).sum())


def test_twice_the_aperture_blurs_twice_as_much():
    lenses = [Lens(aperture_radius_m=radius, focus_distance_m=16.0) for radius in (0.1, 0.2)]
    one, two = map(blur, lenses)
    assert two / one == pytest.approx(2.0, rel=0.05)
    focal_px = 64 / np.tan(np.deg2rad(22.0))
    # A uniform disc of diameter b, seen from the side, has a standard deviation of b / 4.
    assert 4 * one == pytest.approx(lenses[0].blur_px(4.0, focal_px), rel=0.05)


def test_a_pinhole_blurs_nothing():
    lens = Lens(aperture_radius_m=0.0)
    assert lens.blur_px(2.0, 500.0) == 0.0
    assert camera_plugin(2, 2, lens, 1)["type"] == "perspective"
    with pytest.raises(ValueError, match=r"set lens\.aperture_radius_m"):
        Lens(aperture_radius_m=-0.1)


@pytest.fixture(scope="module")
def street():
    """A sunny street with a car and people."""
    return TracedStreet(
        height=96, width=128, samples_per_pixel=4, **asdict(recorded_street("test", 2))
    )


def test_the_same_seed_and_instant_give_equal_pictures(street):
    first = street.photocurrent(300_000)
    other = street.photocurrent(800_000)
    assert (first != other).mean() > 0.7  # all but the sky
    np.testing.assert_array_equal(street.photocurrent(300_000), first)
    again = TracedStreet(**SMALL, **asdict(recorded_street("test", 2)))
    np.testing.assert_array_equal(
        again.photocurrent(300_000),
        TracedStreet(**SMALL, **asdict(recorded_street("test", 2))).photocurrent(300_000),
    )


def test_another_noise_seed_gives_other_noise():
    one, two = (
        TracedStreet(**SMALL, seed=(5, 1), noise_seed=seed).photocurrent(0) for seed in (0, 1)
    )
    assert (one != two).mean() > 0.9
    assert one.mean() == pytest.approx(two.mean(), rel=0.1)


@pytest.mark.parametrize("night", [False, True])
def test_light_is_finite_and_about_as_bright_as_painted(night):
    for seed in range(3):
        traced = TracedStreet(
            height=24, width=32, samples_per_pixel=16, seed=(9, seed), night=night
        )
        picture = traced.photocurrent(500_000)
        assert picture.shape == (24, 32)
        assert picture.dtype == np.float32
        assert np.isfinite(picture).all()
        assert picture.min() >= 0.0
        ratio = np.median(picture) / np.median(traced.world.radiance(500_000))
        assert 0.2 < ratio < 2.0


def test_actors_are_where_the_world_says(street):
    checked = 0
    for index in (0, 2, 3, 4):
        traced = street
        if index != 2:
            traced = TracedStreet(
                height=96, width=128, samples_per_pixel=1, **asdict(recorded_street("test", index))
            )
        for t in (300_000, 1_200_000):
            view, owner = traced.world.view(t), traced.owner(t)
            for number in view.tracks:
                painted, seen = view.owner == number, owner == number
                if painted.sum() < 60:
                    continue
                checked += 1
                assert (painted & seen).sum() / (painted | seen).sum() > 0.7, (index, t, number)
    assert checked > 10


def test_a_car_s_box_is_its_label_s(street):
    view, owner = street.world.view(300_000), street.owner(300_000)
    (number,) = view.tracks[(view.labels == 2) & (view.visible > 0.99)]
    rows, columns = np.nonzero(owner == number)
    found = np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1.0])
    box = view.boxes[list(view.tracks).index(number)]
    low, high = np.maximum(found[:2], box[:2]), np.minimum(found[2:], box[2:])
    both = np.prod(high - low)
    area = np.prod(found[2:] - found[:2]) + np.prod(box[2:] - box[:2])
    assert both / (area - both) > 0.6


def test_the_picture_is_that_of_the_painted_street(street):
    log = np.log(0.1 + np.stack([street.photocurrent(1e6), street.world.radiance(1e6)]))
    assert np.corrcoef(log[0].ravel(), log[1].ravel())[0, 1] > 0.8


def test_a_scene_at_rest_gives_no_event(monkeypatch):
    traced = TracedStreet(**SMALL, seed=(5, 2), still=True)
    at = traced.world.camera(0.0)
    monkeypatch.setattr(traced.world, "camera", lambda _: at)  # the engine is off
    traced._moving.clear()
    frames = np.stack([traced.photocurrent(t) for t in (0, 40_000, 90_000)])
    assert (frames == frames[0]).all()
    levels = frames * (255 / frames.max())
    assert len(ESIM().simulate(levels, [0, 40_000, 90_000])) == 0


def test_a_moving_camera_flickers_less_with_one_noise_seed():
    def share(seeds):
        traced = TracedStreet(height=48, width=64, samples_per_pixel=16, seed=(0, 2, 0, 0))
        pictures = []
        for t, seed in zip((1_000_000, 1_002_500), seeds, strict=True):
            traced.noise_seed = seed
            pictures.append(traced.photocurrent(t))
        return np.mean(np.abs(np.log(pictures[1] / pictures[0])) > 0.2)

    assert share((0, 0)) < 0.7 * share((0, 1))


def test_counts_below_one_are_refused():
    with pytest.raises(ValueError, match=r"set scene\.samples_per_pixel"):
        TracedStreet(height=4, width=4, samples_per_pixel=0, seed=(1,))
