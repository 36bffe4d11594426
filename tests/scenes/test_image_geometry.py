import numpy as np
import pytest

from eqs.scenes.optics import convex_hull, coverage, project, set_edges, signed_area


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
