"""Tables and text of the study of parts, from made-up results whose every number is known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest

from analysis.ablation.options import AblationOptions
from analysis.ablation.parts import WHOLE, chosen_parts
from analysis.ablation.plots import figure
from analysis.ablation.runs import rivals_of, runs
from analysis.ablation.shown import shown_tables
from analysis.ablation.tables import ALL, RunResult, budget_table, floor_table, moment_table, part_table
from analysis.command.console import markdown
from analysis.metrics.budget import SHARES

OPTIONS = AblationOptions(inputs=("fly-by", "chase"), repetitions=2, rivals=("afr",))
PARTS = chosen_parts(("jitter",))
NO_JITTER = PARTS[0].words
TIMES = 4
ERRORS = {WHOLE: 0.2, NO_JITTER: 0.6, "framed": 1.0, "afr": 0.4}
OF_SHARES = dict(zip(SHARES, (0.1, 0.05, 0.04, 0.02, -0.01), strict=True))


def results(**changed) -> list[RunResult]:
    """Errors as above, those of chase twice as large; in the second repetition a half more than in the first."""
    made = []
    for run in runs(OPTIONS, PARTS):
        scale = (2.0 if run.case.input == "chase" else 1.0) * (1.0 + 0.5 * run.repetition)
        mse = np.full(TIMES, {**ERRORS, **changed}[run.label])
        mse = mse * scale
        times = pd.DataFrame({"time_s": np.arange(TIMES) / 30, "mse": mse, "log_mse": mse})
        if run.case.budget_s is not None:
            rest = {"floor": 0.16, **OF_SHARES}
            times = times.assign(**{f"budget_{name}": scale * value for name, value in rest.items()})
            times = times.assign(budget_uncovered=0.25, budget_relit=0.125, budget_late_s=0.008)
        made.append(RunResult(run, times))
    return made


def moments(**changed) -> pd.DataFrame:
    return moment_table(results(**changed), rivals_of(OPTIONS))


def line(table: pd.DataFrame, **place) -> pd.Series:
    for name, value in place.items():
        table = table[table[name] == value]
    assert len(table) == 1
    return table.iloc[0]


def test_every_moment_has_the_errors_beside_it() -> None:
    found = moments()
    assert len(found) == 2 * 2 * 2 * TIMES and set(found["policy"]) == {WHOLE, NO_JITTER}
    assert np.allclose(found["best-rival"], 0.4 * found["framed"])
    assert found[found["policy"] == NO_JITTER]["budget_blur"].isna().all()


def test_what_a_part_is_worth() -> None:
    table = part_table(moments())
    whole, without = (line(table, policy=label, input="chase") for label in (WHOLE, NO_JITTER))
    assert whole["ratio"] == pytest.approx(0.2) and whole["change"] == 1.0
    assert without["ratio"] == pytest.approx(0.6) and without["change"] == pytest.approx(3.0)
    assert without["mse"] == pytest.approx(0.6 * 2.0 * 1.25) and without["framed"] == pytest.approx(2.5)
    assert (without["at most framed"], without["at most best-rival"]) == (1.0, 0.0)
    together = line(table, policy=NO_JITTER, input=ALL)
    assert together["ratio"] == pytest.approx(0.6) and together["change"] == pytest.approx(3.0)


def test_the_mean_over_inputs_is_geometric_and_the_spread_is_of_repetitions() -> None:
    made = results()
    for place, one in enumerate(made):
        if one.run.label == NO_JITTER:
            factor = {"fly-by": 1.0, "chase": 4.0}[one.run.case.input] * (1.0 + one.run.repetition)
            made[place] = dataclasses.replace(one, times=one.times.assign(mse=one.times["mse"] * factor))
    table = part_table(moment_table(made, rivals_of(OPTIONS)))
    found = line(table, policy=NO_JITTER, input="fly-by")
    assert (found["least"], found["most"]) == pytest.approx((0.6, 1.2))
    assert found["ratio"] == pytest.approx((0.6 + 1.5 * 1.2) / 2.5)
    assert line(table, policy=NO_JITTER, input=ALL)["change"] == pytest.approx(found["change"] * 2.0)


def test_the_budget_adds_up_and_the_floor_is_below() -> None:
    found = line(budget_table(moments()), input="fly-by")
    assert [found[name] for name in SHARES] == pytest.approx([*OF_SHARES.values()])
    assert sum(found[name] for name in SHARES) == pytest.approx(found["ratio"]) == pytest.approx(0.2)
    assert found["late_ms"] == pytest.approx(8.0)
    floor = line(floor_table(moments()), input="chase")
    assert (floor["floor"], floor["policy"]) == pytest.approx((0.16, 0.2))
    assert floor["policy / floor"] == pytest.approx(1.25) and floor["at most twice"] == 1.0
    assert line(floor_table(moments(**{WHOLE: 0.5})), input="chase")["at most twice"] == 0.0


@pytest.mark.parametrize("left_out", [WHOLE, NO_JITTER, "framed", "afr"])
def test_runs_that_failed_leave_the_rest(left_out: str) -> None:
    made = [one for one in results() if one.run.label != left_out]
    found = moment_table(made, rivals_of(OPTIONS))
    tables = {"parts": part_table(found), "budget": budget_table(found), "floor": floor_table(found)}
    shown = shown_tables(tables) if len(found) else []
    assert {WHOLE: 2, NO_JITTER: 4, "framed": 0, "afr": 4}[left_out] == len(shown)
    assert "nan" not in markdown(shown)


def test_one_input_that_failed_does_not_move_the_change_of_the_others() -> None:
    made = [one for one in results() if (one.run.label, one.run.case.input) != (NO_JITTER, "chase")]
    table = part_table(moment_table(made, rivals_of(OPTIONS)))
    assert line(table, policy=NO_JITTER, input=ALL)["change"] == pytest.approx(3.0)


def test_the_text_has_every_number() -> None:
    tables = {"parts": part_table(moments()), "budget": budget_table(moments()), "floor": floor_table(moments())}
    text = markdown(shown_tables(tables))
    assert f"| {NO_JITTER} | 0.600 | 0.600 | 0.600 | 100.0 % | 0.0 % |" in text
    assert f"| {NO_JITTER} | 3.00 | 3.00 | 3.00 |" in text
    assert "| chase | 0.100 | 0.050 | 0.040 | 0.020 | -0.010 | 0.200 | 8.0 | 25.0 % | 12.5 % |" in text
    assert "| fly-by | 0.160 | 0.200 | 1.25 | 100.0 % |" in text


def test_the_figure_shows_every_part_and_share() -> None:
    tables = part_table(moments()), budget_table(moments()), floor_table(moments())
    left, right = figure(*tables, 7).axes
    assert [text.get_text() for text in left.get_yticklabels()] == [NO_JITTER]
    dots = {curve.get_label(): curve for curve in left.get_lines()}
    assert np.asarray(dots["chase"].get_xdata()) == pytest.approx([3.0])
    widths = [bar.get_width() for bar in right.patches]
    assert sorted(widths) == pytest.approx(sorted([*OF_SHARES.values()] * 2))
