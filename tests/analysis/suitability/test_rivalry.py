"""Policies beside framed and the best rival, from made-up results."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from analysis.suitability.options import SuitabilityOptions
from analysis.suitability.rivalry import RunGroup, groups_of, lead_table, metric_table, rival_table
from analysis.suitability.runs import Run, runs
from analysis.suitability.tables import Results
from tests.analysis.suitability.builders import TIMES, result

OPTIONS = SuitabilityOptions(
    inputs=("chase", "fly-by"), rows=(0, 7), repetitions=2, rivals=("framed-half", "afr"), beside=(), solvers=()
)
SIDES = {0: 64, 7: 128}
RIVALS = ("framed", *OPTIONS.rivals)
EARLY = np.arange(TIMES) < TIMES // 4


def groups(error: Callable[[Run], object], failed: Callable[[Run], bool] = lambda run: False) -> list[RunGroup]:
    made = [result(run, error(run)) for run in runs(OPTIONS) if not failed(run)]
    return groups_of(Results(made), SIDES, ("thesis", *RIVALS))


def error(run: Run) -> object:
    """The best rival is framed-half at first, 0.25, then afr, 0.5; thesis has 0.75 at row 0, 0.25 at row 7."""
    thesis = 0.75 if run.row == 0 else 0.25
    errors = {"thesis": thesis, "framed-half": np.where(EARLY, 0.25, 2.0), "afr": np.where(EARLY, 3.0, 0.5)}
    return errors.get(run.label, 1.0)


def line(table: pd.DataFrame, row: str, policy: str = "thesis") -> pd.Series:
    return table[table["policy"] == policy].set_index("row").loc[row]


def test_a_policy_stands_beside_framed_and_the_best_rival() -> None:
    table = rival_table(groups(error), ("thesis",), RIVALS)
    assert list(table["row"]) == ["all", "0", "7"] and list(table["runs"]) == [4, 2, 2]
    assert line(table, "7")["setting"] == "128, 512²"
    for row in ("all", "0", "7"):
        found = line(table, row)
        assert found["framed: at most"] == 1.0 and found["framed: always"] == found["framed: 90 %"] == found["runs"]
    slow, fast, both = (line(table, row) for row in ("0", "7", "all"))
    assert slow["best-rival: at most"] == 0.0 and slow["best-rival: median"] == slow["best-rival: worst"] == 1.5
    assert fast["best-rival: at most"] == 1.0 and fast["best-rival: median"] == 0.5
    assert both["best-rival: at most"] == 0.5 and both["best-rival: worst"] == 1.5
    assert (both["best-rival: always"], both["best-rival: 90 %"]) == (2, 2)
    assert both["framed: median"] == pytest.approx(0.5)


def test_most_of_the_time_is_not_always() -> None:
    late = np.where(np.arange(TIMES) < TIMES - 1, 0.5, 1.5)
    table = rival_table(groups(lambda run: late if run.label == "thesis" else 1.0), ("thesis",), RIVALS)
    found = line(table, "all")
    assert (found["framed: always"], found["framed: 90 %"], found["framed: at most"]) == (0, 4, 0.95)


def test_rivals_lead_in_turn() -> None:
    found = groups(error)
    leads = lead_table(found, RIVALS).set_index("row")
    assert leads.loc["all"].to_dict() == {"framed": 0.0, "framed-half": 0.25, "afr": 0.75}
    table = rival_table(found, RIVALS, RIVALS)
    assert line(table, "all", "afr")["best-rival: at most"] == 0.75 and line(table, "all", "framed")["runs"] == 4


def test_every_metric_has_its_own_best_rival() -> None:
    table = metric_table(groups(error), ("thesis",), RIVALS).set_index("metric")
    assert (table["framed: at least as good"] == 1.0).all() and list(table["framed: runs better"]) == [4] * 5
    assert (table.loc[["mse", "flip", "ssim"], "best-rival: at least as good"] == 0.5).all()
    # means: 0.75 and 0.25 of thesis, 1.5625 of framed-half, 1.125 of afr, 1 of framed
    assert list(table["best-rival: runs better"]) == [4] * 5 and list(table["best-rival: runs"]) == [4] * 5
    assert table.loc["jod", "best-rival: at least as good"] == 1.0, "a score of the sequence"


def test_repetitions_are_pooled() -> None:
    """Of two repetitions one is suitable always and one never: the run is suitable half of the time."""
    found = groups(lambda run: (0.5 if run.repetition else 2.0) if run.label == "thesis" else 1.0)
    shown = line(rival_table(found, ("thesis",), RIVALS), "0")
    assert shown["framed: at most"] == 0.5 and shown["framed: 90 %"] == 0 and shown["framed: median"] == 1.25


def test_rivals_that_failed_are_left_out() -> None:
    """The best rival is of those that ran; without framed nothing is compared."""
    without_afr = groups(error, lambda run: run.label == "afr")
    assert lead_table(without_afr, RIVALS).set_index("row").loc["all"].to_dict() == {
        "framed": 0.75,
        "framed-half": 0.25,
    }
    lonely = groups(error, lambda run: run.label == "framed" and run.case.input == "chase")
    assert {group.input for group in lonely} == {"fly-by"}
    assert rival_table([], ("thesis",), RIVALS).empty and metric_table([], ("thesis",), RIVALS).empty
    assert lead_table([], RIVALS).empty


def test_one_row_is_not_summed_up_and_framed_may_be_judged() -> None:
    one = [group for group in groups(error) if group.row == 7]
    assert list(rival_table(one, ("framed",), ("framed",))["row"]) == ["7"]
    assert metric_table(one, ("framed",), ("framed",)).empty, "it has no rival but itself"
