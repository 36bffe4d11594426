"""Solids of actors: where they are, that they are closed, and what moves."""

import numpy as np
import pytest

from eqs.scenes import DrivingWorld, actors
from eqs.scenes.actors import Actor
from eqs.scenes.substances import Substance
from eqs.scenes.traced.shapes import Solid, ball, moves, placed, solids


def actor(parts, **place):
    return Actor(**{"x": 0.0, "z": 10.0, **place}, parts=parts)


CAR = actors.car(0.5, length=4.2, height=1.5, lit=False)


def test_a_car_is_as_large_as_it_was_drawn_and_stands_on_the_ground():
    points = np.concatenate([solid.points for solid in solids(actor(CAR), 0.0).values()])
    low, high = points.min(0), points.max(0)
    assert high[1] == pytest.approx(1.5, abs=0.01)
    assert 0.0 <= low[1] < 0.01
    assert high[2] - low[2] == pytest.approx(4.2, abs=0.03)
    assert high[0] - low[0] == pytest.approx(1.78, abs=0.04)


def test_a_car_has_glass_tyres_paint_and_tail_lamps():
    found = {look.substance for look in solids(actor(CAR), 0.0)}
    assert {Substance.CAR_PAINT, Substance.GLASS, Substance.RUBBER, Substance.TAIL_LAMP} <= found


def test_lit_lamps_shine():
    lit = actors.car(0.5, lit=True)
    assert {look.emit for look in solids(actor(lit), 0.0)} == {0.0, 90.0, 9.0}


def test_a_ball_has_nearly_a_sphere_s_volume():
    row = np.zeros(21)
    row[:5] = 1.0, 2.0, 0.5, 0.0, 3.0
    solid = ball(row)
    assert solid.points.mean(0) == pytest.approx([1.0, 3.0, 2.0], abs=1e-9)
    centred = Solid(solid.points - solid.points.mean(0), solid.triangles)
    radius = np.linalg.norm(centred.points, axis=1)
    assert radius == pytest.approx(np.full(len(radius), 0.5))
    a, b, c = (centred.points[centred.triangles[:, k]] for k in range(3))
    pieces = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c))).sum() / 6
    assert pieces == pytest.approx(4 / 3 * np.pi * 0.5**3, rel=0.02)


def test_heading_and_speed_move_an_actor():
    walker = actor(CAR, heading=np.pi / 2, speed=2.0)
    nose = np.array([[0.0, 1.0, 2.0]])
    assert placed(walker, nose, 0.0)[0] == pytest.approx([2.0, 1.0, 10.0])
    assert placed(walker, nose, 1.5)[0] == pytest.approx([5.0, 1.0, 10.0])
    right = np.array([[1.0, 0.0, 0.0]])
    assert placed(actor(CAR), right, 0.0)[0] == pytest.approx([1.0, 0.0, 10.0])


def test_only_what_moves_is_said_to_move():
    parked, driven = actor(CAR), actor(CAR, speed=3.0)
    standing = actor(actors.pedestrian(0.1, 0.5))
    walking = actor(actors.pedestrian(0.1, 0.5, gait=6.0))
    assert [moves(each) for each in (parked, driven, standing, walking)] == [0, 1, 0, 1]
    for each in (parked, standing):
        before, after = solids(each, 0.0), solids(each, 0.7)
        assert all((before[look].points == after[look].points).all() for look in before)


@pytest.mark.parametrize("seed", range(3))
def test_looks_and_triangles_are_the_same_at_all_times(seed):
    for each in DrivingWorld(height=24, width=32, seed=(5, seed)).actors:
        before, after = solids(each, 0.0), solids(each, 1.3)
        assert before.keys() == after.keys()
        for look, solid in before.items():
            assert solid.points.shape == after[look].points.shape
            assert (solid.triangles == after[look].triangles).all()
            assert solid.triangles.max() == len(solid.points) - 1


def test_a_box_encloses_its_volume():
    (crate,) = (s for s in solids(actor(actors.bin_box(0.3)), 0.0).values())
    faces = crate.points[crate.triangles]
    middle = crate.points.mean(0)
    a, b, c = (faces[:, k] - middle for k in range(3))
    # Every face is counted once: the pyramids on them fill the frustum.
    filled = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c))).sum() / 6
    low, high = 0.6**2, 0.66**2
    assert filled == pytest.approx(1.05 / 3 * (low + high + np.sqrt(low * high)), rel=1e-6)
