"""Scenes that are no street: the same at every look, with boxes around what moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eqs.scenes import FLICKER, HAND_HELD, NEARLY_STILL, PASSING, Manner, ObjectScene
from eqs.scenes.objects import SHAPES, Swing, draw_texture
from eqs.scenes.paint_objects import radius_at

STILL = Manner(camera_shift=0, camera_turn_rad=0, camera_pan_per_s=0, objects=(0, 0))


def scene(manner: Manner, seed: int = 0) -> ObjectScene:
    return ObjectScene(height=48, width=64, seed=(seed, 1), manner=manner)


@pytest.mark.parametrize("manner", [HAND_HELD, PASSING, FLICKER, NEARLY_STILL])
def test_the_same_time_gives_the_same_picture(manner: Manner) -> None:
    one, other = scene(manner), scene(manner)
    later = one.radiance(700_000)
    assert np.isfinite(later).all()
    assert (later > 0).all()
    one.radiance(100_000)
    np.testing.assert_array_equal(one.radiance(700_000), later)
    np.testing.assert_array_equal(other.radiance(700_000), later)


def test_scenes_move_as_their_manner_says() -> None:
    def change(manner: Manner) -> float:
        first, second = (np.log(scene(manner).radiance(t)) for t in (0, 100_000))
        return float(np.abs(second - first).mean())

    assert change(STILL) == 0.0
    assert 0 < change(replace(NEARLY_STILL, objects=(0, 0))) < 0.2 * change(HAND_HELD)


def test_light_flickers_by_the_depth_that_was_asked_for() -> None:
    manner = replace(STILL, flicker=(0.5, 0.5), flicker_hz=(10.0, 10.0))
    means = [scene(manner).radiance(t).mean() for t in range(0, 200_000, 1000)]
    assert min(means) / max(means) == pytest.approx(0.5, abs=0.002)
    assert means[:100] == pytest.approx(means[100:], rel=1e-6)


def test_a_box_holds_its_object_and_touches_it() -> None:
    manner = replace(STILL, objects=(1, 1), object_spin_rad_per_s=5.0, light_lux=(10.0, 10.0))
    checked = 0
    for seed in range(12):
        with_object = scene(manner, seed)
        view = with_object.view(300_000)
        if not len(view.boxes) or view.visible[0] < 1.0:
            continue
        bare = scene(manner, seed)
        bare.objects = []
        changed = with_object.radiance(300_000) != bare.radiance(300_000)
        rows, columns = np.nonzero(changed)
        left, top, right, bottom = view.boxes[0]
        found = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
        assert found == pytest.approx((left, top, right, bottom), abs=1.6)
        assert 8 <= view.labels[0] < 8 + len(SHAPES)
        checked += 1
    assert checked >= 4


def test_outlines_lie_within_the_reach_that_is_painted() -> None:
    reach = [[radius_at(shape, theta) for theta in np.linspace(0, 6.3, 500)] for shape in range(4)]
    assert np.max(reach) < 1.5
    assert np.min(reach) > 0.3
    assert len({round(float(np.std(each)), 3) for each in reach}) == 4


def test_textures_are_shares_of_light_with_edges() -> None:
    texture = draw_texture(np.random.default_rng(3))
    assert texture.shape == (512, 512)
    assert 0 < texture.min() < texture.max() <= 1
    assert np.log(texture).std() > 0.2


def test_a_swing_is_what_its_formula_says() -> None:
    swing = Swing(start=1.0, per_s=2.0, amplitudes=(0.5,), rates_hz=(0.25,), phases=(0.0,))
    assert swing.at(1.0) == pytest.approx(1.0 + 2.0 + 0.5)
