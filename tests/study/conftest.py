"""A small made-up study: three simulators and the real reference, two seeds, four sequences."""

import numpy as np
import pandas as pd
import pytest

from eqs.study import eqs_table, study_table

QUALITY = {"esim": 0.72, "v2e": 0.66, "pix2nvs": 0.41}
ACCURACY = {
    "real": (0.26, 0.26),
    "esim": (0.31, 0.22),
    "v2e": (0.34, 0.19),
    "pix2nvs": (0.2, 0.08),
}


@pytest.fixture
def scores() -> pd.DataFrame:
    rng = np.random.default_rng(3)
    rows = []
    for name, quality in QUALITY.items():
        for index in range(4):
            value = quality + 0.05 * index + 0.01 * rng.normal()
            rows.append(
                {
                    "simulator": name,
                    "sequence": f"test_{index:02d}",
                    "eqs": value,
                    "eqs_gate_raw": 0.99,
                    "eqs_hidden_centred": value,
                    "eqs_chance": 0.21,
                    "eqs_ceiling": 0.93,
                    "n_windows": 50,
                    "n_events_real": 40_000,
                    "n_events_sim": 52_345,
                    "definition": "12345678",
                    "weights_sha256": "1e10" * 16,
                }
            )
    return eqs_table(rows)


@pytest.fixture
def study(scores: pd.DataFrame) -> pd.DataFrame:
    rows = [
        {
            "simulator": name,
            "seed": seed,
            "map_sim": sim + 0.01 * seed,
            "map50_sim": 2 * sim,
            "map_real": real - 0.01 * seed,
            "map50_real": 2 * real,
            "ap_real_car": real + 0.1,
            "ap_real_cyclist": -1.0,
            "protocol": "0042",
        }
        for name, (sim, real) in ACCURACY.items()
        for seed in range(2)
    ]
    return study_table(rows, scores)
