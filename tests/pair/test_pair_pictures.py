"""Pictures in data URIs, read back as a browser would."""

from __future__ import annotations

import base64
import io

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from eqs.events import Events
from eqs.pair import PageWindows, event_uri, map_uri, shown_windows
from eqs.pair.pictures import AGREE, DIFFER, NOTHING, PALETTE


def read(uri: str) -> NDArray[np.uint8]:
    kind, _, data = uri.partition(",")
    assert kind == "data:image/png;base64"
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))


def test_the_last_event_of_a_pixel_is_seen() -> None:
    events = Events.from_arrays(
        t=[0, 1, 2], x=[3, 3, 5], y=[1, 1, 2], p=[0, 1, 0], height=4, width=6
    )
    image = read(event_uri(events))
    assert image.shape == (4, 6, 3)
    assert tuple(image[1, 3]) == PALETTE[6:]
    assert tuple(image[2, 5]) == PALETTE[3:6]
    assert (image.reshape(-1, 3) == PALETTE[:3]).all(axis=1).sum() == 4 * 6 - 2


def test_large_sensors_lose_no_event_and_pictures_stay_small() -> None:
    events = Events.from_arrays(t=[0, 1], x=[1279, 0], y=[719, 0], p=[1, 1], height=720, width=1280)
    image = read(event_uri(events))
    assert image.shape == (180, 320, 3)
    assert tuple(image[-1, -1]) == tuple(image[0, 0]) == PALETTE[6:]


def test_a_map_lies_over_the_picture_and_is_grey_where_nothing_counts() -> None:
    similarity = np.array([[1.0, 0.0, 0.5], [np.nan, -0.3, 1.0]])
    image = read(map_uri(similarity, 12, height=16, width=30))  # the last patches reach beyond
    assert image.shape == (16, 30, 3)
    assert tuple(image[0, 0]) == tuple(image[11, 11]) == AGREE
    assert tuple(image[0, 12]) == DIFFER
    assert tuple(image[12, 0]) == NOTHING
    assert tuple(image[15, 12]) == DIFFER  # below zero is no worse in a picture
    assert tuple(image[15, 29]) == AGREE
    even = read(map_uri(similarity, None, height=16, width=30))
    assert tuple(even[7, 9]) == AGREE
    assert tuple(even[8, 9]) == NOTHING


def test_long_recordings_show_some_of_their_windows() -> None:
    shown = shown_windows(5_000)
    assert len(shown) == len(set(shown)) == 200
    assert (shown[0], shown[-1]) == (0, 4_999)
    assert max(np.diff(shown)) - min(np.diff(shown)) <= 1


@pytest.mark.parametrize(("most", "kept"), [(10_000, 8), (300, 4), (20, 1), (1, 1)])
def test_a_page_stays_small_whatever_its_pictures_weigh(most: int, kept: int) -> None:
    pictures = ["x" * 20] * 8
    windows = PageWindows(
        numbers=[*range(8)], simulated=pictures, real=pictures, maps=[str(n) for n in range(8)]
    )
    fewer = windows.within(most)
    assert len(fewer.numbers) == len(fewer.real) == kept
    assert fewer.maps == [str(number) for number in fewer.numbers]
