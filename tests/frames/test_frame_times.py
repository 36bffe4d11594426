"""Times of a folder's frames, in units that are told, and by the numbers of an engine's frames."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from eqs.frames.times import counted_times, frame_times, times_file
from eqs.pipelines.simulate import open_clip

IMAGES = [Path(f"frame_{number:06d}.png") for number in (120, 121, 124)]
WANTED = [50_000, 100_000, 250_000]


@pytest.fixture
def clip(tmp_path):
    for path in IMAGES:
        Image.new("L", (4, 3)).save(tmp_path / path)
    return tmp_path


@pytest.mark.parametrize(
    ("unit", "lines"),
    [
        ("s", ["0.05", "0.1", "0.25"]),
        # As an engine adds up float32 steps; 1e-1 is how some write it.
        ("s", ["0.05000000074505806", "1e-1", "0.2499999"]),
        ("ms", ["50", "100.0", "250"]),
        ("us", ["50000", "100000", "250000"]),
        ("ns", ["50000000", "100000499", "249999501"]),
    ],
)
def test_times_of_every_unit_become_microseconds(clip, unit, lines):
    path = clip / "timestamps.txt"
    path.write_text("# made for a test\n" + "\n".join(lines) + "\n")
    assert frame_times(path, unit, IMAGES).tolist() == WANTED
    assert open_clip(clip, None, time_unit=unit).timestamps_us.tolist() == WANTED
    path.rename(clip / f"timestamps_{unit}.txt")
    assert open_clip(clip, None).timestamps_us.tolist() == WANTED


def test_times_of_an_epoch_lose_nothing(tmp_path):
    path = tmp_path / "timestamps.txt"
    path.write_text("1700000000.123456\n1700000000.123457\n")
    expected = [1_700_000_000_123_456, 1_700_000_000_123_457]
    assert frame_times(path, "s", IMAGES[:2]).tolist() == expected


def test_lines_of_two_numbers_belong_to_the_frames_that_are_there(clip):
    rows = [f"{number}, {number * 0.05 - 5.95:.9f}" for number in range(118, 130)]
    (clip / "timestamps_s.txt").write_text("\n".join(reversed(rows)))
    assert open_clip(clip, None).timestamps_us.tolist() == WANTED
    (clip / "timestamps_s.txt").write_text("\n".join(rows[:5]))
    with pytest.raises(ValueError, match=r"a time for frame 124 \(frame_000124.png\) in"):
        open_clip(clip, None)


@pytest.mark.parametrize(
    ("name", "unit", "lines", "wanted"),
    [
        ("timestamps.txt", None, "0.05\n0.1\n0.25", "whole microseconds in .* set time_unit=s"),
        ("timestamps.txt", "ns", "0.5\n1\n2", "whole nanoseconds"),
        ("timestamps.txt", "h", "1\n2\n3", "a unit among s, ms, us, ns, got 'h'"),
        ("timestamps_ns.txt", "us", "1\n2\n3", "Expected times in us, got .*timestamps_ns.txt"),
        ("timestamps.txt", None, "1\n2 3\n4", r"got lines of \[1, 2\] numbers"),
        ("timestamps.txt", None, "", "got lines of no numbers"),
        ("timestamps.txt", None, "1\nnan\n3", "write numbers alone"),
        ("timestamps.txt", None, "1\n2s\n3", "got '2s'"),
        ("timestamps.txt", None, "1\n2", "one time for each of the 3 images"),
        ("timestamps.txt", None, "120 1\n120 2", "every frame once"),
        ("timestamps.txt", None, "a 1\nb 2", "a frame's whole number"),
    ],
)
def test_what_is_no_time_ends_in_a_sentence(clip, name, unit, lines, wanted):
    (clip / name).write_text(lines)
    with pytest.raises(ValueError, match=wanted):
        open_clip(clip, None, time_unit=unit)


def test_two_files_of_times_are_one_too_many(clip):
    (clip / "timestamps.txt").write_text("1\n2\n3\n")
    (clip / "timestamps_s.txt").write_text("1\n2\n3\n")
    with pytest.raises(ValueError, match=r"timestamps.txt and timestamps_s.txt; keep one"):
        times_file(clip)


def test_numbers_with_gaps_are_times_or_not_as_is_told(clip):
    with pytest.raises(ValueError, match="steps of 1 to 3; set frame_numbers=true if"):
        open_clip(clip, 20)
    assert open_clip(clip, 20, frame_numbers=True).timestamps_us.tolist() == [0, 50_000, 200_000]
    assert open_clip(clip, 20, frame_numbers=False).timestamps_us.tolist() == [0, 50_000, 100_000]


def test_equal_steps_and_names_without_numbers_need_no_word():
    every_second = [Path(f"{number}.png") for number in (10, 12, 14)]
    assert counted_times(every_second, 10, None).tolist() == [0, 100_000, 200_000]
    assert counted_times(every_second, 10, True).tolist() == [0, 200_000, 400_000]
    named = [Path("a.png"), Path("b.png")]
    assert counted_times(named, 10, None).tolist() == [0, 100_000]
    with pytest.raises(ValueError, match="a number in the name of every frame"):
        counted_times(named, 10, True)


def test_a_rate_of_thirds_is_rounded_down():
    found = counted_times([Path(f"{k}.png") for k in range(4)], 30, None)
    np.testing.assert_array_equal(found, [0, 33_333, 66_666, 100_000])
