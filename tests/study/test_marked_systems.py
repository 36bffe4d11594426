"""Systems that are no simulators like others: marked, explained, and no points of a correlation."""

import pandas as pd

from eqs.study import answer, correlations, eqs_table, study_table
from eqs.study.notes import notes
from eqs.study.tables import independent, simulated, summarise_eqs, summarise_study

WHY = "learned from the sensor that judges it"
SCORES = {"esim": 0.6, "v2e": 0.7, "eventgan†": 0.99}
ACCURACY = {"esim": 0.15, "v2e": 0.2, "eventgan†": 0.01}


def scores():
    return eqs_table(
        [
            {"simulator": name.rstrip("†"), "system": name, "sequence": sequence, "eqs": score}
            | {"caveat": WHY if name.endswith("†") else ""}
            for name, score in SCORES.items()
            for sequence in ("a", "b")
        ]
    )


def study():
    rows = [
        {
            "simulator": name.rstrip("†"), "system": name, "seed": seed,
            "map_sim": 0.3, "map50_sim": 0.5, "map_real": real, "map50_real": real,
            "caveat": WHY if name.endswith("†") else "",
        }
        for name, real in ACCURACY.items()
        for seed in (0, 1)
    ]  # fmt: skip
    return study_table(rows, scores())


def test_they_are_no_points_of_a_correlation():
    for result in correlations(study()):
        assert [name for name, _, _ in result.points] == ["esim", "v2e"]
        assert result.families == 2


def test_they_keep_their_rows_and_their_reason():
    assert list(summarise_eqs(scores())["caveat"]) == ["", "", WHY]
    means = summarise_study(study())
    assert dict(zip(means["system"], means["caveat"], strict=True))["eventgan†"] == WHY
    assert len(simulated(study())) == 6
    assert set(independent(simulated(study()))["system"]) == {"esim", "v2e"}


def test_notes_say_what_the_mark_stands_for():
    assert f"eventgan†: {WHY}, so it is no point of a correlation." in notes(scores())
    plain = scores()[lambda table: table["caveat"] == ""]
    assert not any("correlation" in note for note in notes(plain))
    assert not any("correlation" in note for note in notes(plain.drop(columns="caveat")))


def test_the_answer_asks_whether_the_others_were_foreseen():
    sentences = answer(scores(), study(), correlations(study()))
    assert "It puts 1 of 1 pairs of simulators" in sentences[-1]
    assert "eventgan†" in sentences[0]


def test_tables_of_before_have_no_marks():
    old = study().drop(columns="caveat")
    assert isinstance(independent(old), pd.DataFrame)
    assert len(independent(old)) == len(old)
