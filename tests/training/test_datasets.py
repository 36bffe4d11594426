"""Batches hold what their recordings say, whoever reads them and in whatever order."""

import numpy as np
import pytest
import torch

from eqs.data import LabelProtocol, Recording
from eqs.events import Events
from eqs.representations import stacked_histogram
from eqs.training import (
    Augmentation,
    Binning,
    EvaluationDataset,
    TrainingDataset,
    WindowSource,
)

PROTOCOL = LabelProtocol(name="test", classes={"pedestrian": [0], "car": [2]})


@pytest.fixture(scope="module")
def recordings(tmp_path_factory, make_recording):
    """Three recordings of 5, 8 and 3 windows; the second has frames without labels."""
    root = tmp_path_factory.mktemp("recordings")
    labels = [(1_000_000 + 50_000 * index, 3, 3, 12, 9, 2) for index in (2, 5)]
    labels += [(1_100_000, 20, 2, 8, 20, 0)]
    return [
        Recording.load(make_recording(root / "a", frames=6, seed=1)),
        Recording.load(make_recording(root / "b", frames=9, seed=2, tracks=labels)),
        Recording.load(make_recording(root / "c", frames=4, seed=3)),
    ]


def sources_of(recordings, protocol=PROTOCOL, cache=None, **binning):
    return [
        WindowSource(
            recording=recording,
            events_path=recording.events_path,
            protocol=protocol,
            binning=Binning(**{"bins": 3, **binning}),
            cache=cache,
        )
        for recording in recordings
    ]


def training(recordings, protocol=PROTOCOL, **options):
    settings = {"seed": 1, "steps": 50, "batch_size": 4, "sequence_length": 3, **options}
    return TrainingDataset(sources_of(recordings, protocol), **settings)


def same_batch(a, b):
    return a.keys() == b.keys() and all(torch.equal(a[name], b[name]) for name in a)


def test_batch_has_the_agreed_shapes_and_types(recordings):
    batch = training(recordings)[0]
    shapes = {name: (tuple(each.shape), each.dtype) for name, each in batch.items()}
    assert shapes.pop("labels") == ((3, 4, batch["labels"].shape[2], 5), torch.float32)
    assert shapes == {
        "histograms": ((3, 4, 6, 24, 32), torch.uint8),
        "labelled": ((3, 4), torch.bool),
        "first": ((4,), torch.bool),
        "stream": ((4,), torch.bool),
    }
    assert batch["stream"].tolist() == [True, True, False, False]


def test_stream_slot_shows_the_recordings_windows_and_labels(recordings):
    dataset = training(recordings, batch_size=1, stream_share=1)
    for step in range(12):
        chunk, batch = dataset.schedule.chunk(step, 0), dataset[step]
        recording = recordings[chunk.recording]
        events = Events.load(recording.events_path)
        for time in range(3):
            shown = batch["histograms"][time, 0].numpy()
            if time >= chunk.count:
                assert shown.sum() == 0
                assert not batch["labelled"][time, 0]
                assert batch["labels"][time, 0].abs().sum() == 0
                continue
            stop = int(recording.frame_times_us[chunk.start + time + 1])
            expected = stacked_histogram(
                events, 3, start_us=stop - 50_000, stop_us=stop, count_cutoff=10
            )
            np.testing.assert_array_equal(shown, expected)
            tracks = recording.tracks[recording.tracks["t"] == stop]
            rows = batch["labels"][time, 0]
            rows = rows[rows[:, 3] > 0]
            assert batch["labelled"][time, 0]
            assert len(rows) == len(tracks)
            centres = {(row["x"] + row["w"] / 2, row["y"] + row["h"] / 2) for row in tracks}
            assert {(float(x), float(y)) for x, y in rows[:, 1:3]} == centres


def test_frames_without_boxes_count_only_where_labels_are_exhaustive(recordings):
    unsure = LabelProtocol(name="u", classes=PROTOCOL.classes, score_empty_frames=False)
    for protocol, expected in ((PROTOCOL, 8), (unsure, 2)):
        source = sources_of(recordings, protocol)[1]
        assert len(source.labelled_windows()) == expected
        batches = list(iterate(EvaluationDataset([source])))
        assert sum(int(batch["labelled"].sum()) for batch in batches) == expected


def histograms_of(sources):
    return [source.histogram(index) for source in sources for index in range(len(source))]


def test_histograms_are_binned_once_and_read_again(recordings, tmp_path, monkeypatch):
    plain = histograms_of(sources_of(recordings))
    first = histograms_of(sources_of(recordings, cache=tmp_path))
    monkeypatch.setattr(WindowSource, "_binned", lambda *_: pytest.fail("binned again"))
    again = histograms_of(sources_of(recordings, cache=tmp_path))
    assert len(list(tmp_path.glob("*/*.h5"))) == len(plain) == 16
    for kept in (first, again):
        assert all(np.array_equal(a, b) for a, b in zip(plain, kept, strict=True))


def test_other_events_or_bins_are_not_taken_from_the_cache(recordings, tmp_path, make_recording):
    recording = Recording.load(make_recording(tmp_path / "data" / "a", frames=4, seed=8))
    cache = tmp_path / "cache"
    before = histograms_of(sources_of([recording], cache=cache))
    fewer = histograms_of(sources_of([recording], cache=cache, bins=2))
    capped = histograms_of(sources_of([recording], cache=cache, count_cutoff=1))
    Events.load(recording.events_path).shifted(10_000).save(recording.events_path)
    after = histograms_of(sources_of([recording], cache=cache))
    plain = histograms_of(sources_of([recording]))
    assert fewer[0].shape[0] == 4
    assert max(each.max() for each in capped) == 1
    assert not all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(plain, after, strict=True))


def iterate(dataset):
    return (dataset[index] for index in range(len(dataset)))


def test_random_samples_always_end_at_a_label(recordings):
    unsure = LabelProtocol(name="u", classes=PROTOCOL.classes, score_empty_frames=False)
    dataset = training(recordings[1:2], unsure, stream_share=0)
    batches = list(iterate(dataset))
    assert len(batches) == 50
    assert all(batch["labelled"].any(dim=0).all() for batch in batches)


def test_batches_do_not_depend_on_order_or_copies(recordings):
    options = {"augmentation": Augmentation()}
    dataset = training(recordings, **options)
    forwards = [dataset[step] for step in range(20)]
    fresh = training(recordings, **options)
    for step in reversed(range(20)):
        assert same_batch(fresh[step], forwards[step])
    assert not same_batch(training(recordings, seed=2, **options)[3], forwards[3])


def test_augmented_stream_keeps_its_view_through_a_recording(recordings):
    plain = training(recordings, batch_size=1, stream_share=1, sequence_length=2)
    moved = training(
        recordings,
        batch_size=1,
        stream_share=1,
        sequence_length=2,
        augmentation=Augmentation(flip_probability=0.5, stream_zoom_probability=0.0),
    )
    flips = {}
    for step in range(27):
        before, after = plain[step]["histograms"], moved[step]["histograms"]
        flipped = torch.equal(before.flip(-1), after)
        assert flipped or torch.equal(before, after)
        key = moved.schedule.chunk(step, 0).key
        assert flips.setdefault(key, flipped) == flipped
    assert set(flips.values()) == {True, False}


def test_augmented_boxes_stay_inside_and_visible(recordings):
    for batch in iterate(training(recordings, augmentation=Augmentation())):
        rows = batch["labels"].reshape(-1, 5)
        rows = rows[rows[:, 3] > 0]
        low, high = rows[:, 1:3] - rows[:, 3:] / 2, rows[:, 1:3] + rows[:, 3:] / 2
        assert (low >= -1e-4).all()
        assert (high <= torch.tensor([32.0, 24.0]) + 1e-4).all()
        assert (rows[:, 3:] >= 1 - 1e-4).all()


def test_crop_applies_to_events_and_boxes(recordings):
    cropped = LabelProtocol(name="c", classes=PROTOCOL.classes, crop_rows=16)
    full = training(recordings)[4]
    batch = training(recordings, cropped)[4]
    assert torch.equal(batch["histograms"], full["histograms"][..., :16, :])
    bottom = batch["labels"][..., 2] + batch["labels"][..., 4] / 2
    assert bottom.max() <= 16
    assert full["labels"].shape[:2] == batch["labels"].shape[:2]


def test_evaluation_shows_every_window_once_in_order(recordings):
    dataset = EvaluationDataset(sources_of(recordings), chunk_length=3)
    batches = list(iterate(dataset))
    assert [len(batch["times_us"]) for batch in batches] == [3, 2, 3, 3, 2, 3]
    assert [batch["recording"].item() for batch in batches] == [0, 0, 1, 1, 1, 2]
    assert [batch["first"].item() for batch in batches] == [True, False, True, False, False, True]
    times = torch.cat([batch["times_us"] for batch in batches]).tolist()
    assert times == [t for each in recordings for t in each.frame_times_us[1:].tolist()]


def test_evaluation_does_not_depend_on_the_chunk_length(recordings):
    def flat(length):
        batches = list(iterate(EvaluationDataset(sources_of(recordings), chunk_length=length)))
        return torch.cat([batch["histograms"] for batch in batches])

    assert torch.equal(flat(1), flat(4))


def test_recordings_of_two_sizes_are_refused(recordings, tmp_path, make_recording):
    other = Recording.load(make_recording(tmp_path / "wide", width=40))
    with pytest.raises(ValueError, match=r"of one size, got 32x24, 40x24; set data\.splits"):
        training([*recordings, other])


def test_recordings_without_labels_are_refused(tmp_path, make_recording):
    bare = Recording.load(make_recording(tmp_path / "bare", tracks=None))
    with pytest.raises(ValueError, match="labelled windows to train on, got none"):
        training([bare])
    assert not EvaluationDataset(sources_of([bare]))[0]["labelled"].any()


def test_no_recordings_are_refused():
    with pytest.raises(ValueError, match="two frames or more, got none"):
        training([])
