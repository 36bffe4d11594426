import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle

from eqs.drawing import (
    Boxes,
    detection_panels,
    event_image,
    event_rate,
    events_panels,
    rate_curves,
    save_figure,
    score_maps,
)
from eqs.drawing.style import BRIGHTER, DARKER, colours
from eqs.events import Events
from eqs.study import (
    FIGURE_TEXTS,
    accuracy_bars,
    correlations,
    report_figure,
    score_against_accuracy,
    sequence_dots,
)


def stream(n, height=6, width=8, seed=0):
    rng = np.random.default_rng(seed)
    return Events.from_arrays(
        np.sort(rng.integers(0, 100_000, n)),
        rng.integers(0, width, n),
        rng.integers(0, height, n),
        rng.integers(0, 2, n),
        height=height,
        width=width,
    )


def titles(drawing):
    return [axes.get_title(loc="left") for axes in drawing.axes]


FRAME = np.full((6, 8), 128, np.uint8)


def test_event_image_shows_the_last_event_of_a_pixel():
    events = Events.from_arrays([1, 2, 3], [0, 0, 2], [1, 1, 0], [0, 1, 0], height=3, width=4)
    image = event_image(events)
    assert image.shape == (3, 4, 3)
    assert image[1, 0] == pytest.approx(to_rgb(BRIGHTER))
    assert image[0, 2] == pytest.approx(to_rgb(DARKER))
    assert (image.sum(axis=2) == 3).sum() == 10


def test_event_rate_counts_per_pixel_and_second():
    events = Events.from_arrays([0, 9, 10, 29], [0] * 4, [0] * 4, [1] * 4, height=2, width=5)
    rates = event_rate(events, 0, 35, 10)
    assert rates.tolist() == pytest.approx([2e4, 1e4, 1e4])
    with pytest.raises(ValueError, match="at least one bin of 10 us, got 9 us"):
        event_rate(events, 0, 9, 10)


def test_rate_keeps_every_event():
    events = stream(500)
    rates = event_rate(events, 0, 100_000, 5_000)
    assert rates.sum() * 5e-3 * events.height * events.width == pytest.approx(500)


def test_same_time_shows_every_event_real_first():
    streams = {"esim": stream(300), "real": stream(200, seed=1)}
    drawing = events_panels(FRAME, streams, start_us=0, stop_us=100_000)
    assert titles(drawing) == ["video frame", "real sensor: 200 events", "esim: 300 events"]
    assert "same 100 ms" in drawing.get_suptitle()


def test_same_count_shows_the_last_events_before_the_instant():
    streams = {"esim": stream(300), "real": stream(200, seed=1)}
    drawing = events_panels(None, streams, start_us=0, stop_us=100_000, same="count")
    assert titles(drawing) == ["real sensor: 200 events", "esim: 200 events"]
    expected = event_image(streams["esim"][100:])
    assert np.array_equal(drawing.axes[1].get_images()[0].get_array(), expected)


def test_events_panels_refuse_nothing_to_show():
    with pytest.raises(ValueError, match="at least one stream"):
        events_panels(FRAME, {}, start_us=0, stop_us=1)


def test_detections_below_the_threshold_are_not_drawn():
    truth = Boxes(corners=np.array([[1, 1, 3, 4.0]]), labels=np.array([0]))
    found = Boxes(
        corners=np.array([[1, 1, 3, 4.0], [2, 2, 5, 5]]),
        labels=np.array([0, 1]),
        scores=np.array([0.9, 0.1]),
    )
    nothing = Boxes(corners=np.zeros((0, 4)), labels=np.zeros(0, int), scores=np.zeros(0))
    drawing = detection_panels(
        stream(50), truth, {"esim": found, "v2e": nothing}, class_names=["car", "pedestrian"]
    )
    boxes = [sum(isinstance(p, Rectangle) for p in axes.patches) for axes in drawing.axes]
    assert boxes == [1, 2, 1]
    assert titles(drawing)[1:] == ["trained on esim: 1 found", "trained on v2e: 0 found"]


def test_boxes_refuse_fields_of_different_length():
    with pytest.raises(ValueError, match=r"corners of shape \(2, 4\)"):
        Boxes(corners=np.zeros((1, 4)), labels=np.zeros(2, int))
    with pytest.raises(ValueError, match="1 scores"):
        Boxes(corners=np.zeros((2, 4)), labels=np.zeros(2, int), scores=np.zeros(1))


def test_score_maps_share_one_scale_and_crop_padding():
    maps = {"esim": [[0.2, 0.9], [0.5, np.nan]], "v2e": [[-0.1, 0.3], [0.2, 0.2]]}
    drawing = score_maps(FRAME, maps, patch_px=5, height=6, width=8)
    images = [axes.get_images()[0] for axes in drawing.axes[1:3]]
    assert [image.get_clim() for image in images] == [(-0.1, 0.9)] * 2
    assert images[0].get_extent() == [-0.5, 9.5, 9.5, -0.5]
    assert drawing.axes[1].get_xlim() == (-0.5, 7.5)
    assert titles(drawing)[1] == "esim: mean 0.533"
    with pytest.raises(ValueError, match="at least one map"):
        score_maps(FRAME, {}, patch_px=5, height=6, width=8)


def test_scatter_names_every_simulator_and_the_good_direction(study, scores):
    drawing = score_against_accuracy(study, scores, correlations(study))
    assert len(drawing.axes) == 4
    for axes in drawing.axes:
        words = [text.get_text() for text in axes.texts]
        assert {"chance", "ceiling"} <= set(words)
        assert "better" in axes.get_xlabel()
        assert "better" in axes.get_ylabel()
        assert "too few" in axes.get_title(loc="left") or axes.get_title(loc="left") == ""
    names = [text.get_text() for text in drawing.legends[0].get_texts()]
    assert names == ["esim", "v2e", "pix2nvs"]
    lower = ["lower is better" in axes.get_ylabel() for axes in drawing.axes]
    assert lower == [False, False, True, True]


def test_bars_are_the_means_over_seeds(study):
    axes = accuracy_bars(study).axes[0]
    heights = [bar.get_height() for bar in axes.patches]
    assert heights[:3] == pytest.approx([31.5, 34.5, 20.5])
    assert np.isnan(heights[3])  # real events have no simulated test; they come last
    assert heights[4:] == pytest.approx([21.5, 18.5, 7.5, 25.5])


def test_dots_hold_every_sequence(scores):
    axes = sequence_dots(scores).axes[0]
    drawn = np.concatenate([dots.get_offsets()[:, 0] for dots in axes.collections])
    assert sorted(drawn) == pytest.approx(sorted(scores["eqs"]))


def test_the_real_sensor_is_drawn_last_and_black():
    drawing = rate_curves({"real": [1.0, 2.0], "esim": [2.0, 3.0]}, bin_us=10)
    curves = drawing.axes[0].patches
    assert [curve.get_label() for curve in curves] == ["esim", "real sensor"]
    assert curves[1].get_edgecolor()[:3] == (0, 0, 0)
    assert colours(["esim", "real", "v2e"])["real"] == "#000000"
    assert colours(["v2e", "esim"])["esim"] == colours(["esim", "real", "v2e"])["esim"]


def test_saved_figures_are_whole_and_repeatable(tmp_path):
    names = ["a", "b"]
    for name in names:
        drawing = rate_curves({"real": [1.0, 2.0]}, bin_us=10)
        assert save_figure(drawing, tmp_path / name, "rates") == tmp_path / name / "rates.png"
    for file in ("rates.png", "rates.svg"):
        first, second = ((tmp_path / name / file).read_bytes() for name in names)
        assert first == second
    assert sorted(f.name for f in (tmp_path / "a").iterdir()) == ["rates.png", "rates.svg"]


def test_report_figure_brings_its_text(tmp_path):
    drawing = rate_curves({"real": [1.0, 2.0]}, bin_us=10)
    entry = report_figure(drawing, tmp_path, "event_rates", note="Bins of 10 us.")
    assert entry.title == FIGURE_TEXTS["event_rates"][0]
    assert entry.caption.endswith("Bins of 10 us.")
    assert entry.path.is_file()
    with pytest.raises(ValueError, match="Expected a figure among"):
        report_figure(drawing, tmp_path, "rates")
