import numpy as np
import pytest

from eqs.scenes.optics import convex_hull, coverage, project, set_edges, signed_area
from eqs.scenes.paint_actors import _paint_actor
from eqs.scenes.parts import SOLID
from eqs.scenes.polygons import EDGES, JOIN, X0, X1, Y0, Y1, Polygons


def camera(**change):
    values = {"x": 0.0, "y": 1.5, "z": 0.0, "yaw": 0.0, "pitch": 0.0, "roll": 0.0} | change
    return np.array(
        [
            values["x"],
            values["y"],
            values["z"],
            np.cos(values["yaw"]),
            np.sin(values["yaw"]),
            values["pitch"],
            values["roll"],
            100.0,
            48.0,
            64.0,
        ]
    )


def seen(x, y, z, **change):
    point = np.zeros(2)
    depth = project(x, y, z, camera(**change), point)
    return point[0], point[1], depth


def edges_of(corners):
    corners = np.array(corners, float)
    edges = np.zeros((8, 3))
    return edges, set_edges(corners, len(corners), edges)


def test_points_ahead_fall_on_the_middle():
    assert seen(0.0, 1.5, 10.0) == (64.0, 48.0, 10.0)


def test_right_is_right_and_low_is_low():
    column, row, _ = seen(1.0, 0.5, 10.0)
    assert (column, row) == (74.0, 58.0)


def test_yaw_to_the_right_moves_things_left():
    column, _, _ = seen(0.0, 1.5, 10.0, yaw=0.1)
    assert column == pytest.approx(64.0 - 100.0 * np.tan(0.1))


def test_points_behind_the_camera_stay_at_the_near_plane():
    assert seen(3.0, 1.5, -5.0)[2] == pytest.approx(0.4)


def test_hull_of_a_square_with_points_inside():
    points = np.array([[0, 0], [2, 2], [1, 1], [2, 0], [0.5, 1.2], [0, 2], [1, 0.3], [0.2, 0.2]])
    hull = np.zeros((16, 2))
    count = convex_hull(points.astype(float), 8, hull)
    assert count == 4
    assert abs(signed_area(hull, count)) == pytest.approx(4.0)


def test_edges_do_not_depend_on_the_direction_of_the_corners():
    square = [[0, 0], [4, 0], [4, 3], [0, 3]]
    for corners in (square, square[::-1]):
        edges, count = edges_of(corners)
        inside = edges[:count] @ [1.0, 1.0, 1.0]
        assert count == 4
        assert sorted(inside) == pytest.approx([1.0, 1.0, 2.0, 3.0])


def test_a_polygon_without_area_has_no_edges():
    assert edges_of([[0, 0], [1, 1], [2, 2]])[1] == 0


@pytest.mark.parametrize("width", [0.1, 0.6, 1.0, 3.7])
@pytest.mark.parametrize("offset", [0.0, 0.3, 0.77])
def test_coverage_of_an_upright_strip_is_its_width(width, offset):
    edges, count = edges_of(
        [[5 + offset, -9], [5 + offset + width, -9], [5 + offset + width, 9], [5 + offset, 9]]
    )
    total = sum(coverage(edges, count, k + 0.5, 0.5, 0.0) for k in range(20))
    assert total == pytest.approx(width)


def test_coverage_changes_smoothly_when_a_polygon_moves():
    previous = None
    for shift in np.linspace(0.0, 3.0, 301):
        edges, count = edges_of([[shift, 0.0], [shift + 2.3, 0.4], [shift + 1.0, 3.0]])
        now = coverage(edges, count, 3.5, 1.5, 0.0)
        if previous is not None:
            assert abs(now - previous) < 0.03
        previous = now


def test_total_coverage_of_a_large_polygon_is_its_area():
    corners = [[3.2, 2.1], [25.7, 6.3], [20.1, 27.9], [6.4, 22.2]]
    edges, count = edges_of(corners)
    total = sum(coverage(edges, count, x + 0.5, y + 0.5, 0.0) for x in range(32) for y in range(32))
    assert total == pytest.approx(abs(signed_area(np.array(corners), 4)), rel=0.01)


@pytest.mark.parametrize("size", [1.5, 6.0, 25.0])
def test_a_filled_polygon_has_the_coverage_of_its_pixels(size):
    # Filling by row spans is only a faster way to the coverage of every single pixel.
    rng = np.random.default_rng(3)
    for _ in range(40):
        polygons, layers = Polygons.room_for(1), np.zeros((3, 32, 40))
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, 5))
        corners = np.stack([np.cos(angles), np.sin(angles)], axis=1) * size / 2.0
        corners += rng.uniform(5.0, 25.0, 2)
        count = set_edges(corners, 5, polygons.edges[0])
        polygons.marks[0, [EDGES, JOIN, X0, X1, Y0, Y1]] = (count, SOLID, 0, 40, 0, 32)
        polygons.values[0] = (7.0, 0.0, 1.0)
        _paint_actor(layers, polygons, 0, 1)
        expected = [
            [coverage(polygons.edges[0], count, x + 0.5, y + 0.5, 0.0) for x in range(40)]
            for y in range(32)
        ]
        np.testing.assert_allclose(layers[1], expected, atol=1e-9)
        np.testing.assert_allclose(layers[0], 7.0 * np.array(expected), atol=1e-9)
