"""Faithful mode against events that the published programs produced."""

import json
from pathlib import Path

import numpy as np
import pytest

from eqs.simulators import ESIM, ICNS, PIX2NVS, V2E, Prophesee

FOLDER = Path(__file__).parents[1] / "golden" / "sim"
PIX2NVS_MODES = {1: "previous", 2: "replace", 3: "integrate"}


def esim(given):
    return ESIM(
        mode="faithful",
        threshold_on_log=given["threshold_on"],
        threshold_off_log=given["threshold_off"],
        refractory_us=given["refractory_s"] * 1e6,
        log_offset=given["log_eps"],
    )


def v2e(given):
    return V2E(
        mode="faithful",
        threshold_on_log=given["pos_thres"],
        threshold_off_log=given["neg_thres"],
        threshold_sigma_log=given["sigma_thres"],
        cutoff_hz=given["cutoff_hz"],
        leak_hz=given["leak_rate_hz"],
        shot_noise_hz=given["shot_noise_rate_hz"],
        refractory_us=given["refractory_period_s"] * 1e6,
    )


def pix2nvs(given):
    return PIX2NVS(
        mode="faithful",
        threshold_log=given["threshold"],
        adaptation=given["alpha"],
        max_events=given["n_max"],
        block=given["block"],
        reference_update=PIX2NVS_MODES[given["mode"]],
    )


def prophesee(given):
    return Prophesee(
        mode="faithful",
        threshold_on_log=given["Cp"],
        threshold_off_log=given["Cn"],
        threshold_sigma_log=given["sigma_threshold"],
        cutoff_hz=given["cutoff_hz"],
        leak_hz=given["leak_rate_hz"],
        shot_noise_hz=given["shot_noise_rate_hz"],
        refractory_us=given["refractory_period"],
    )


def icns(given):
    return ICNS(
        mode="faithful",
        threshold_on_log=given["th_pos"],
        threshold_off_log=given["th_neg"],
        threshold_sigma_log=given["th_noise"],
        latency_us=given["lat"],
        jitter_us=given["jit"],
        refractory_us=given["ref"],
        time_constant_us=given["tau"],
        background_on_hz=given["bgnp"],
        background_off_hz=given["bgnn"],
    )


def matched(times, others, tolerance_us):
    """How many of two sorted lists of times pair up, each used once."""
    pairs, at = 0, 0
    for time in times:
        while at < len(others) and others[at] < time - tolerance_us:
            at += 1
        if at < len(others) and others[at] <= time + tolerance_us:
            pairs, at = pairs + 1, at + 1
    return pairs


def by_pixel(x, y, p, t):
    groups = {}
    for key, time in sorted(zip(zip(x, y, p, strict=True), t, strict=True)):
        groups.setdefault(tuple(int(value) for value in key), []).append(int(time))
    return groups


@pytest.mark.parametrize(
    ("name", "build", "share"),
    [
        ("esim_0", esim, 0.998),
        ("esim_1", esim, 0.998),
        ("v2e_0", v2e, 1.0),
        ("v2e_1", v2e, 1.0),
        ("pix2nvs_0", pix2nvs, 1.0),
        ("pix2nvs_1", pix2nvs, 1.0),
        ("prophesee_0", prophesee, 1.0),
        ("prophesee_1", prophesee, 1.0),
        ("icns_0", icns, 1.0),
    ],
)
def test_faithful_mode_gives_the_published_events(name, build, share):
    with np.load(FOLDER / f"{name}.npz") as golden:
        frames, times = golden["frames"], golden["t_us"]
        given = json.loads(str(golden["params"]))
        # The C++ program of PIX2NVS counts rows from the bottom.
        y = frames.shape[1] - 1 - golden["y"].astype(int) if build is pix2nvs else golden["y"]
        expected = by_pixel(golden["x"], y, golden["p"], np.floor(golden["t"]))
    events = build(given).simulate(frames, times)
    found = by_pixel(events.x, events.y, events.p, events.t)
    total = sum(len(group) for group in expected.values())
    pairs = sum(matched(group, found.get(key, []), 1) for key, group in expected.items())
    assert pairs >= share * max(total, len(events))
