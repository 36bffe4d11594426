import numpy as np
import pytest

from eqs.scenes import DrivingWorld, LabelRule

SIZE = {"height": 48, "width": 64}


@pytest.fixture(scope="module")
def world():
    return DrivingWorld(**SIZE, seed=(0, 0, 3, 0))


def test_one_instant_has_one_picture_whatever_came_before(world):
    first = world.radiance(700_000)
    world.radiance(2_000_000)
    world.view(100_000)
    np.testing.assert_array_equal(first, world.radiance(700_000))


def test_one_seed_is_one_world(world):
    same, other = (DrivingWorld(**SIZE, seed=(0, 0, k, 0)) for k in (3, 4))
    np.testing.assert_array_equal(world.radiance(5_000), same.radiance(5_000))
    assert not np.array_equal(world.radiance(5_000), other.radiance(5_000))


@pytest.mark.parametrize("night", [False, True])
def test_light_is_finite_and_positive_everywhere(night):
    for seed in range(6):
        world = DrivingWorld(**SIZE, seed=(9, seed), night=night)
        for t in (0, 1_500_000, 3_000_000):
            picture = world.radiance(t)
            assert picture.dtype == np.float32
            assert np.isfinite(picture).all()
            assert picture.min() > 0.0


@pytest.mark.parametrize("night", [False, True])
def test_scene_has_a_high_dynamic_range(night):
    picture = DrivingWorld(**SIZE, seed=(9, 1), night=night).radiance(1_000_000)
    assert picture.max() / picture.min() > (300.0 if night else 30.0)


def test_night_is_at_least_thirty_times_darker():
    day, night = (
        np.median([DrivingWorld(**SIZE, seed=(9, k), night=n).radiance(0) for k in range(4)])
        for n in (False, True)
    )
    assert day > 30.0 * night


def test_a_millisecond_changes_little(world):
    log = np.log([world.radiance(1_000_000 + 1000 * k) for k in range(40)])
    change = np.abs(np.diff(log, axis=0))
    assert np.mean(change) < 0.02
    assert np.mean(change > 0.25) < 0.004


def test_ten_times_finer_steps_change_about_ten_times_less(world):
    def largest_usual_change(step_us):
        log = np.log([world.radiance(800_000 + step_us * k) for k in range(20)])
        return np.quantile(np.abs(np.diff(log, axis=0)), 0.99)

    assert largest_usual_change(100) < 0.25 * largest_usual_change(1000)


def test_a_still_world_moves_less_than_a_driven_one():
    def activity(still):
        changes = []
        for seed in range(24):
            world = DrivingWorld(**SIZE, seed=(7, seed), still=still)
            log = np.log([world.radiance(t) for t in (1_000_000, 1_020_000)])
            changes.append(np.abs(log[1] - log[0]).mean())
        return np.median(changes)  # a passer-by near the camera outweighs any shaking

    # The engine runs on, so that it still shakes.
    assert activity(still=True) < 0.8 * activity(still=False)


def test_boxes_bound_the_visible_pixels():
    seen = 0
    for seed in range(10):
        world = DrivingWorld(height=96, width=128, seed=(5, seed))
        view = world.view(1_200_000)
        for box, track in zip(view.boxes, view.tracks, strict=True):
            rows, columns = np.nonzero(view.owner == track)
            if not len(rows):
                continue
            seen += 1
            # A pixel belongs to an actor if half of it is covered: its centre is inside.
            assert box[0] - 0.5 <= columns.min() + 0.5
            assert columns.max() + 0.5 <= box[2] + 0.5
            assert box[1] - 0.5 <= rows.min() + 0.5
            assert rows.max() + 0.5 <= box[3] + 0.5
    assert seen > 20


def test_unhidden_actors_fill_their_boxes():
    filled = []
    for seed in range(8):
        view = DrivingWorld(height=96, width=128, seed=(5, seed)).view(600_000)
        for box, track, visible in zip(view.boxes, view.tracks, view.visible, strict=True):
            inside = box[0] > 1 and box[1] > 1 and box[2] < 127 and box[3] < 95
            if visible < 0.999 or not inside or min(box[2] - box[0], box[3] - box[1]) < 6:
                continue
            rows, columns = np.nonzero(view.owner == track)
            extent = (np.ptp(columns) + 1) * (np.ptp(rows) + 1)
            filled.append(extent / ((box[2] - box[0]) * (box[3] - box[1])))
    assert len(filled) >= 5
    assert np.median(filled) > 0.75


def test_visible_shares_are_shares_and_some_actors_are_hidden():
    shares = np.concatenate(
        [DrivingWorld(height=96, width=128, seed=(5, k)).view(0).visible for k in range(6)]
    )
    assert shares.min() >= 0.0
    assert shares.max() <= 1.0 + 1e-9
    assert 0.1 < (shares < 0.9).mean() < 0.9


def test_every_class_appears_and_tracks_keep_their_class():
    found = set()
    for seed in range(3):
        world, classes = DrivingWorld(**SIZE, seed=(5, seed)), {}
        for t in range(0, 3_000_000, 300_000):
            view = world.view(t)
            for track, label in zip(view.tracks, view.labels, strict=True):
                assert classes.setdefault(int(track), int(label)) == label
        found |= set(classes.values())
    assert {0, 1, 2} <= found


def test_labels_are_clipped_and_large_enough(world):
    rule = LabelRule()
    kept = 0
    for t in range(0, 3_000_000, 200_000):
        rows = rule.boxes(world.view(t), 1_000 + t)
        kept += len(rows)
        assert (rows["t"] == 1_000 + t).all()
        assert (rows["x"] >= 0).all()
        assert (rows["x"] + rows["w"] <= 64 + 1e-4).all()
        assert (rows["y"] + rows["h"] <= 48 + 1e-4).all()
        assert (rows["w"] >= rule.smallest_width * 64 - 1e-4).all()
        assert (rows["visibility"] >= rule.least_visible).all()
    assert kept > 10


def test_label_rule_thresholds_act(world):
    views = [world.view(t) for t in range(0, 3_000_000, 200_000)]

    def count(**change):
        return sum(len(LabelRule(**change).boxes(view, 0)) for view in views)

    assert count(smallest_height=0.3) < count()
    assert count(smallest_width=0.2) < count()
    assert count(least_visible=0.99) < count()
    assert count(least_inside=0.99) < count()


@pytest.mark.parametrize("factor", [2, 4])
def test_larger_pictures_show_the_same_street(factor):
    small = DrivingWorld(height=48, width=64 * 2, seed=(3, 3))
    large = DrivingWorld(height=48 * factor, width=128 * factor, seed=(3, 3))
    for one, other in zip(small.actors, large.actors, strict=True):
        assert one.row() == other.row()
    picture = large.radiance(900_000).reshape(48, factor, 128, factor).mean((1, 3))
    log = np.log([small.radiance(900_000), picture])
    assert np.corrcoef(log[0].ravel(), log[1].ravel())[0, 1] > 0.9
