"""Tables of a suitability study from made-up results."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from analysis.study.cases import ROWS
from analysis.study.inputs import INPUTS
from analysis.study.thesis import SHARES, SUITABLE_PERCENTILE
from analysis.suitability.options import SuitabilityOptions
from analysis.suitability.plots import boxes
from analysis.suitability.runs import Run, runs
from analysis.suitability.tables import (
    Results,
    RunResult,
    cause_table,
    disagreement_table,
    percentile_table,
    policy_table,
    rank_table,
    region_table,
    run_table,
    share_table,
    vote_table,
)
from tests.analysis.suitability.builders import TIMES, result

OPTIONS = SuitabilityOptions(
    inputs=("chase", "fly-by"), rows=(6, 7), repetitions=2, rivals=("framed-super", "frameless", "afr")
)
HALF = np.where(np.arange(TIMES) < TIMES // 2, 0.5, 2.0)
"""Half of the ratios below 1."""


def made(error) -> Results:
    """All runs; ``error(run)`` is the error of each, 1 for framed ones."""
    return Results([result(run, 1.0 if run.label == "framed" else error(run)) for run in runs(OPTIONS)])


def test_percentiles_stand_beside_the_thesis() -> None:
    table = percentile_table(made(lambda run: 0.5 if run.case.input == "fly-by" else HALF))
    assert list(table["row"]) == [6, 7] and [(b, s) for b, s in zip(table["batch"], table["side"], strict=True)] == [
        ROWS[6], ROWS[7]]  # fmt: skip
    assert list(table["fly-by"]) == [100.0, 100.0]
    assert table["chase"].between(45, 55).all() and (table["chase least"] <= table["chase most"]).all()
    for name in ("chase", "fly-by"):
        assert list(table[f"{name} thesis"]) == [SUITABLE_PERCENTILE[row][INPUTS.index(name)] for row in (6, 7)]


def test_runs_without_a_whole_cycle_have_their_lines() -> None:
    """Such as on a machine whose cycles take most of the run: the summary of the run has nothing per cycle."""
    whole = made(lambda run: 0.5)
    gone = ("cycles", "cycle_s", "invariants")
    short = [
        RunResult(one.run, {name: value for name, value in one.summary.items() if name not in gone}, one.times)
        for one in whole.all
    ]
    table = run_table(Results(short))
    assert len(table) == 8 and not table["cycles"].any() and table["cycle_s"].isna().all()
    assert table["invariants_ok"].all() and (table["median"] == 0.5).all()
    assert vote_table(Results(short)).equals(vote_table(whole))


def test_repetitions_are_pooled() -> None:
    """A run that is suitable always and one that never is make one suitable half of the time."""
    table = percentile_table(made(lambda run: 0.5 if run.repetition == 0 else 2.0))
    assert table["chase"].between(45, 55).all()
    assert set(table["chase least"]) == {0.0} and set(table["chase most"]) == {100.0}


def test_shares_and_their_intervals() -> None:
    table = share_table(made(lambda run: 0.5 if run.case.input == "fly-by" else HALF)).set_index("share")
    assert list(table.index) == list(SHARES) and list(table["thesis"]) == list(SHARES.values())
    assert table["ours"].tolist() == pytest.approx([0.75, 0.5, 0.5, 0.5])
    assert (table["low"] == table["ours"]).all() and (table["high"] == table["ours"]).all(), "repetitions agree"


def test_intervals_cover_what_repetitions_differ_by() -> None:
    table = share_table(made(lambda run: 0.5 if run.repetition == 0 else 2.0)).set_index("share")
    first = table.loc["ratios at most 1"]
    assert first["ours"] == 0.5 and first["low"] == 0.0 and first["high"] == 1.0
    again = share_table(made(lambda run: 0.5 if run.repetition == 0 else 2.0)).set_index("share")
    assert table.equals(again), "the draws are seeded"


def test_intervals_are_of_95_percent() -> None:
    """Of three repetitions one differs: it is drawn three times with a chance of 1/27, which is 3.7 %; an interval of
    95 % holds that case, one of 90 % does not."""
    options = SuitabilityOptions(inputs=("chase",), rows=(7,), repetitions=3, solvers=())

    def tables(error) -> tuple[pd.Series, pd.Series]:
        results = Results([result(run, error(run)) for run in runs(options)])
        policies = policy_table(results, 7, 128).set_index("policy")
        return share_table(results).set_index("share").loc["ratios at most 1"], policies.loc["thesis"]

    def error(run: Run, different: float, others: float) -> float:
        if run.label == "thesis":
            return different if run.repetition == 0 else others
        return 0.0 if run.label == "oracle" else 1.0

    shares, gains = tables(lambda run: error(run, 2.0, 0.5))
    assert (shares["low"], shares["ours"], shares["high"]) == (0.0, pytest.approx(2 / 3), 1.0)
    assert (gains["oracle_share_low"], gains["oracle_share_high"]) == (-1.0, 0.5)
    shares, gains = tables(lambda run: error(run, 0.5, 2.0))
    assert (shares["low"], shares["ours"], shares["high"]) == (0.0, pytest.approx(1 / 3), 1.0)
    assert (gains["oracle_share_low"], gains["oracle_share_high"]) == (-1.0, 0.5)


def test_whiskers_of_the_figure_end_within_one_and_a_half_boxes() -> None:
    """Ratios 10 … 18 with one of 25: the box reaches from 11.5 to 16, a whisker to 22.75 at most."""
    options = SuitabilityOptions(inputs=("chase",), rows=(7,), repetitions=1, rivals=(), beside=(), solvers=())
    ratios = np.resize(np.arange(9.0) + 10.0, TIMES)
    ratios[0] = 25.0
    figure = boxes(Results([result(r, 1.0 if r.label == "framed" else ratios) for r in runs(options)]), ["chase"], "")
    assert figure is not None
    drawn = [line.get_ydata() for line in figure.axes[0].get_lines()]
    assert any(list(line) == [25.0] for line in drawn), "an outlier"
    reached = [max(line) for line in drawn if len(line) == 2 and max(line) > 16.0]
    assert set(reached) == {18.0}


def test_one_repetition_has_no_interval() -> None:
    planned = [run for run in runs(OPTIONS) if run.repetition == 0]
    table = share_table(Results([result(run, 1.0 if run.label == "framed" else 0.5) for run in planned]))
    assert table["ours"].tolist() == [1.0] * 4 and table["low"].isna().all()


ERRORS = {
    "thesis": 0.7,
    "oracle": 0.4,
    "afr": 0.25,
    "frameless": 1.3,
    "thesis trivial": 1.0,
    "framed-super": 0.85,
}


def test_gains_are_measured_against_the_oracle() -> None:
    table = policy_table(made(lambda run: ERRORS[run.label]), 7, 128).set_index(["input", "policy"])
    gains = table.loc["chase"]["oracle_share"]
    assert gains["framed"] == 0.0 and gains["oracle"] == 1.0 and gains["thesis"] == pytest.approx(0.5)
    assert gains["frameless"] == pytest.approx(-0.5) and gains["afr"] == pytest.approx(1.25)
    assert gains["framed-super"] == pytest.approx(0.25)
    assert table.loc["chase"]["ratio"]["thesis"] == pytest.approx(0.7)
    assert table.loc["chase"]["jod"]["oracle"] == pytest.approx(10 - 40)


def test_without_an_oracle_there_is_no_share() -> None:
    planned = [run for run in runs(OPTIONS) if run.label != "oracle"]
    table = policy_table(Results([result(run, 1.0) for run in planned]), 7, 128)
    assert table["oracle_share"].isna().all() and not table["ratio"].isna().any()


def test_disagreements_of_metrics_are_listed() -> None:
    """Of the two inputs one has a better SSIM although its MSE is worse."""
    found = []
    for run in runs(OPTIONS):
        odd = {"ssim": 0.9} if run.label == "thesis" and run.case.input == "chase" else {}
        found.append(result(run, 1.0 if run.label == "framed" else 2.0, **odd))
    table = disagreement_table(Results(found))
    assert set(table["input"]) == {"chase"} and len(table) == 4
    assert (table["mse"] == -1).all() and (table["ssim"] == 1).all()
    assert disagreement_table(made(lambda run: 0.5)).empty


def test_votes() -> None:
    table = vote_table(made(lambda run: 0.5 if run.case.input == "chase" else 2.0)).set_index("metric")
    assert table.loc["mse"].tolist() == [4, 8] and table.loc["ssim"].tolist() == [4, 8]
    assert table.loc["jod"].tolist() == [2, 4], "only the first repetition has a score"
    assert vote_table(Results([])).empty


def test_ranks() -> None:
    table = rank_table(made(lambda run: 0.1 + 0.1 * (run.row or 0) + 0.01 * INPUTS.index(run.case.input)))
    assert np.allclose(table["rank correlation"], 1.0)
    assert set(table["runs"]) == {8, 4}, "only the first repetition has a score"


def test_causes_are_averaged_where_they_are_known() -> None:
    found = []
    for run in runs(OPTIONS):
        known = np.where(np.arange(TIMES) % 2 == 0, 1.0, 0.5)
        lag = np.where(known == 1.0, 0.25, 99.0)
        found.append(result(run, 1.0, aliasing=0.5, blur=0.0, lag=lag, mixed=0.25, causes_mse=1.0, causes_known=known))
    table = cause_table(Results(found), 7, 128).set_index(["input", "policy"]).loc["chase"]
    assert set(table.index) == {*ERRORS, "framed"}
    assert (table["lag"] == 0.25).all() and (table["aliasing"] == 0.5).all() and (table["times"] == TIMES / 2).all()


def test_regions_are_averaged_over_repetitions() -> None:
    found = []
    for run in runs(OPTIONS):
        one = result(run, 1.0)
        regions = {"still plain": {"lag": 0.25 + run.repetition, "share": 0.5}}
        found.append(RunResult(run, {**one.summary, "regions": regions}, one.times))
    table = region_table(Results(found), 7, 128).set_index(["input", "policy"]).loc["chase"]
    assert set(table.index) == {*ERRORS, "framed"} and set(table["region"]) == {"still plain"}
    assert (table["lag"] == 0.75).all() and (table["share"] == 0.5).all()
    assert region_table(Results([]), 7, 128).empty


def test_missing_runs_leave_the_others() -> None:
    """A failed framed run takes its pairs out, and nothing else."""
    planned = [run for run in runs(OPTIONS) if not (run.label == "framed" and run.case.input == "chase")]
    results = Results([result(run, 1.0 if run.label == "framed" else 0.5) for run in planned])
    table = percentile_table(results)
    assert table["chase"].isna().all() and (table["fly-by"] == 100).all()
    assert len(run_table(results)) == 4 and share_table(results)["ours"].tolist() == [1.0] * 4
    assert math.isnan(policy_table(results, 7, 128).set_index(["input", "policy"]).loc[("chase", "thesis"), "ratio"])


def test_nothing_at_all() -> None:
    results = Results([])
    assert run_table(results).empty and share_table(results).empty and disagreement_table(results).empty
