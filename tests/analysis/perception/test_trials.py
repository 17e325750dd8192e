"""Tables of trials count for what they say, or are refused in a line that says where."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.command.cli import InputError
from analysis.perception.analysis import comparisons, fits, strongest
from analysis.perception.observers import drawn_observers, simulated_trials
from analysis.perception.trials import checked_trials, read_trials, undisturbed

STIMULI = pd.DataFrame(
    [
        {"scene": "planescene", "point_set": name, "time_filter": "box", "samples": level, "jod": 2.0 / level**0.5}
        for name in ("hammersley", "poisson")
        for level in (1, 8, 64)
    ]
)
GOOD = simulated_trials(STIMULI, drawn_observers(3, 1, 0.1, 0.1), 2, 1)


@pytest.mark.parametrize(
    "written",
    [
        lambda right: right.map({True: "1", False: "0"}),
        lambda right: right.map({True: "yes", False: "No"}),
        lambda right: right.map({True: "TRUE", False: " false "}),
        lambda right: right.map({True: "1", False: "0"}).astype("category"),
        lambda right: right.astype(int),
        lambda right: right.astype(float),
        lambda right: right.astype(object),
        lambda right: right.astype("boolean"),
    ],
)
def test_answers_are_right_or_wrong_however_they_are_written(written: Any) -> None:
    assert 0.0 < GOOD["correct"].mean() < 1.0
    found, kind = checked_trials(GOOD.assign(correct=written(GOOD["correct"])), "table")
    assert kind == "simulated" and found["correct"].dtype == bool
    assert found["correct"].tolist() == GOOD["correct"].tolist()


def test_trials_without_an_answer_are_left_out() -> None:
    for none in (None, np.nan, pd.NA):
        correct = GOOD["correct"].astype(object)
        correct.iloc[[0, 5]] = none
        found, _ = checked_trials(GOOD.assign(correct=correct), "table")
        assert found["correct"].tolist() == GOOD["correct"].drop([0, 5]).tolist()


def test_levels_and_names_are_converted_where_that_is_honest() -> None:
    changed = GOOD.assign(samples=GOOD["samples"].astype(str), observer=GOOD["observer"].str[1:].astype(int))
    found, _ = checked_trials(changed, "table")
    assert found["samples"].tolist() == GOOD["samples"].tolist() and set(found["observer"]) == {"0", "1", "2"}


def spoilt(column: str, value: Any) -> pd.DataFrame:
    changed = GOOD[column].astype(object)
    changed.iloc[3] = value
    return GOOD.assign(**{column: changed})


@pytest.mark.parametrize(
    ("column", "value", "expected"),
    [
        *[("correct", value, "right or wrong") for value in ("maybe", "", 2, 0.5, -1, "2", [1], float("inf"))],
        *[("samples", value, "a whole number of samples") for value in (None, "many", 0, -8, 2.5, float("inf"), True)],
        *[("scene", value, "a name without slashes") for value in (None, "", "../x", "a/b", 1.5, ".x")],
        ("observer", None, "a name"),
        ("observer_kind", None, "a name"),
        ("time_filter", "\0", "a name"),
    ],
)
def test_a_value_that_a_column_cannot_hold_is_named(column: str, value: Any, expected: str) -> None:
    with pytest.raises(InputError, match=rf"table: column {column}, row 3: expected {expected}.*, got "):
        checked_trials(spoilt(column, value), "table")


def test_an_answer_that_contradicts_its_sides_is_named() -> None:
    with pytest.raises(InputError, match=r"column correct, row 3: expected (True|False) for the answer (left|right)"):
        checked_trials(spoilt("correct", not GOOD["correct"][3]), "table")
    checked_trials(spoilt("correct", not GOOD["correct"][3]).assign(differing_side=""), "table")


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (GOOD.drop(columns="samples"), "no column samples"),
        (GOOD.assign(observer_kind=["human", "simulated"] * (len(GOOD) // 2)), "one kind, got human, simulated"),
        (GOOD.assign(correct=None), "answered trials, got none"),
        (GOOD.iloc[:0], "answered trials, got none"),
    ],
)
def test_tables_that_are_no_trials(bad: pd.DataFrame, message: str) -> None:
    with pytest.raises(InputError, match=message):
        checked_trials(bad, "table")


def test_one_condition_has_fits_and_nothing_to_compare() -> None:
    trials, _ = checked_trials(GOOD.loc[GOOD["point_set"] == "poisson"], "table")
    tested = comparisons(trials)
    assert tested.empty and "p" in tested.columns
    best = strongest(tested)
    assert best.empty and "corrected_p" in best.columns
    assert len(fits(trials, 10, 0)) == 4


def test_sessions_are_read_together_from_csv_and_parquet_with_the_columns_that_are_used(tmp_path: Path) -> None:
    first, second = tmp_path / "a.csv", tmp_path / "b.parquet"
    short = GOOD[["observer", "samples", "correct"]]
    short.iloc[::2].assign(correct=lambda rows: rows["correct"].map({True: "yes", False: "no"})).to_csv(first)
    short.iloc[1::2].to_parquet(second)
    trials, kind = read_trials([first, second])
    assert kind == "unknown" and len(trials) == len(GOOD) and set(trials["scene"]) == {"all"}
    assert trials["correct"].sum() == GOOD["correct"].sum() and set(trials["observer"]) == set(GOOD["observer"])
    assert list(fits(trials, 0, 0)["trials"]) == [len(GOOD)] * 4
    GOOD.to_parquet(second)
    with pytest.raises(InputError, match=r"of one kind, got unknown in .*a\.csv, simulated in .*b\.parquet"):
        read_trials([first, second])
    for path in (tmp_path / "gone.csv", tmp_path / "gone.parquet"):
        with pytest.raises(InputError, match=f"{path}: cannot be read as") as error:
            read_trials([path])
        assert "\n" not in str(error.value)
    first.write_text("observer,samples\nA,8\n")
    with pytest.raises(InputError, match=r"a\.csv: expected a table of trials, found no column correct"):
        read_trials([first])


def test_trials_that_did_not_fit_or_dropped_frames_are_left_out(tmp_path: Path) -> None:
    file, rows = tmp_path / "a.csv", GOOD.head(6)
    rows.assign(fits_window=[True, False, True, True, True, True], dropped_frames=[0, 0, 2, -1, 0, 1]).to_csv(file)
    trials, _ = read_trials([file])
    assert list(undisturbed(trials).index) == [0, 3, 4]
    assert len(undisturbed(GOOD)) == len(GOOD), "nothing is said of them"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("between", [",", ", ", ";", "\t"])
def test_csv_as_spreadsheets_write_it(encoding: str, between: str, tmp_path: Path) -> None:
    rows = [("Observer", " Samples", "correct "), ("é", "8,0" if between == ";" else "8.0", "yes"), ("b", "64", "")]
    path = tmp_path / "a.csv"
    path.write_bytes("\r\n".join(between.join(row) for row in rows).encode(encoding))
    trials, _ = read_trials([path])
    assert trials[["observer", "samples", "correct"]].to_numpy().tolist() == [["é", 8, True]]


HEAD = "observer,samples,correct\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (HEAD + '"a ""b"", c",8,yes\n', [['a "b", c', 8, True]]),
        (HEAD + "A,8,yes,\nB,16,no,\n", [["A", 8, True], ["B", 16, False]]),  # separators at ends of rows alone
        ("sep=;\n" + HEAD.replace(",", ";") + "A;8;yes\n", [["A", 8, True]]),
        (HEAD.replace("\n", "\r") + "A,8,yes\rB,16,no\r", [["A", 8, True], ["B", 16, False]]),
        ('observer,samples,correct,"what; they; said; then"\nA,8,yes,x\n', [["A", 8, True]]),
        (HEAD + "007,8,yes\n7,8,no\n1.0,8,no\n", [["007", 8, True], ["7", 8, False], ["1.0", 8, False]]),
        (HEAD + "NA,8,yes\nNone,8,NA\nnull,8,no\n", [["NA", 8, True], ["null", 8, False]]),
    ],
)
def test_names_and_ends_of_rows_of_csv_are_what_they_say(text: str, expected: list, tmp_path: Path) -> None:
    """Observers 007 and 7 are two, and NA may be one."""
    path = tmp_path / "a.csv"
    path.write_bytes(text.encode())
    trials, _ = read_trials([path])
    assert trials[["observer", "samples", "correct"]].to_numpy().tolist() == expected


def test_tables_that_say_two_things_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(HEAD + "A,8,yes,x\nB,8,yes,y\n")
    with pytest.raises(InputError, match="rows have more values than there are columns"):
        read_trials([path])
    path.write_text(HEAD + "A,8,yes\n")
    with pytest.raises(InputError, match=r"expected different tables, got .*a\.csv twice"):
        read_trials([path, path])


@pytest.mark.parametrize("name", ["Samples", "samples"])
def test_columns_that_differ_in_case_alone_are_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"observer,samples,{name},correct\na,8,16,yes\n")
    with pytest.raises(InputError, match=r"a\.csv: cannot be read as CSV \(two columns samples\)"):
        read_trials([path])
