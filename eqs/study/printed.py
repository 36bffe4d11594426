"""The numbers printed in the EQS paper, on DSEC, to stand beside a study's own.

Source: Chanda et al., "Event Quality Score (EQS): Assessing the Realism of Simulated Event Camera
Streams via Distances in Latent Space", CVPR Workshops 2025.
"""

from __future__ import annotations

from typing import Final

import pandas as pd

from eqs.study.tables import Drops, drops

SCORES_TABLE: Final = 2
"""The paper's number of the table that `printed_scores` repeats."""

ACCURACY_TABLE: Final = 3
"""The paper's number of the table that `printed_accuracy` repeats."""

_SIMULATORS = ("v2e", "esim", "pix2nvs")
_SCORES = {
    "interlaken_00_c": (0.66, 0.72, 0.44),
    "zurich_city_01_e": (0.83, 0.88, 0.52),
    "zurich_city_04_f": (0.74, 0.79, 0.61),
    "zurich_city_14_b": (0.81, 0.91, 0.74),
    "thun_01_a": (0.75, 0.84, 0.69),
    "average": (0.758, 0.828, 0.599),
    "all of DSEC": (0.773, 0.866, 0.501),
}
_ACCURACY = {"v2e": (0.371, 0.143), "esim": (0.344, 0.186), "pix2nvs": (0.171, 0.054)}


def printed_scores() -> pd.DataFrame:
    """EQS as printed: five sequences of 300 frames, their average, the average over all of DSEC.

    The third average is printed as 0.599; its five entries give 0.600.
    """
    return pd.DataFrame.from_dict(_SCORES, orient="index", columns=list(_SIMULATORS))


def printed_accuracy() -> pd.DataFrame:
    """Accuracy (mAP) as printed, here in [0, 1], and the drops that follow from it."""
    rows = {name: (*pair, *drops(*pair)) for name, pair in _ACCURACY.items()}
    columns = ["map_sim", "map_real", *Drops._fields]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)
