"""Which runs the study of precision has, and its tables."""

from __future__ import annotations

import pandas as pd
import pytest

from analysis.precision.options import PrecisionOptions
from analysis.precision.runs import KEPT, OWN, TEXTURES, Run, runs
from analysis.precision.tables import RunResult, format_table, least_safe, run_table, same_for, shown_tables
from tsar.policies import POLICIES
from tsar.policies.stored import Stored
from tsar.policy import Setting

OPTIONS = PrecisionOptions(inputs=("chase", "fly-by"), policies=("tsar",))


def result(run: Run, mse: float, asked: str, broken: bool = False) -> RunResult:
    return RunResult(run, mse, list(asked), broken)


def results(options: PrecisionOptions, of: dict[tuple[str, str], tuple[float, str, bool]]) -> list[RunResult]:
    """Results of every run; runs that are not named equal the unchanged policy."""
    return [result(run, *of.get((run.kept, run.form), (2.0, "abcd", False))) for run in runs(options)]


def test_every_run_differs_from_the_one_it_is_compared_to() -> None:
    planned = runs(PrecisionOptions(inputs=("chase",), repetitions=2))
    assert len({run.case for run in planned}) == len(planned)
    assert len(planned) == 2 * sum(1 + sum(map(len, forms.values())) for forms in KEPT.values())
    assert {run.case.phase for run in planned if run.repetition == 1} == {0.5}
    textures = [run for run in planned if run.kept == TEXTURES]
    assert textures and all(run.case.tracing == (("texels", run.form),) for run in textures)
    assert all(run.case.formats for run in planned), "what is asked for is noted"


@pytest.mark.parametrize("policy", KEPT)
def test_policies_keep_what_is_listed(policy: str) -> None:
    case = runs(PrecisionOptions(inputs=("chase",), policies=(policy,)))[0].case  # type: ignore[arg-type]
    names = {name: "float32" for name in KEPT[policy] if name != TEXTURES}
    Stored(Setting(case.tsar), POLICIES[policy], names)


def test_batches_are_alike_until_the_first_that_differs() -> None:
    assert same_for("abcd", "abcd") == 4
    assert same_for("abcd", "abxd") == 2
    assert same_for("abc", "abcd") == 3
    assert same_for("", "abcd") == 0


def test_changes_are_over_the_run_of_the_same_place() -> None:
    of = {("colors", "float16"): (2.5, "abxx", False), ("colors", "unorm8"): (2.01, "abcd", False)}
    lines = run_table(results(OPTIONS, of))
    assert len(lines) == len(runs(OPTIONS)) - 2, "the policy as it is has no line of its own"
    one = lines[(lines["kept"] == "colors") & (lines["format"] == "float16") & (lines["input"] == "chase")].iloc[0]
    assert one["change"] == 1.25 and one["batches alike"] == 2 and one["batches"] == 4 and one["bits"] == 16
    assert run_table([one for one in results(OPTIONS, of) if one.run.form != OWN]).empty


def test_the_least_safe_format_has_the_fewest_bits_of_those_that_cost_little() -> None:
    of = {
        ("colors", "float16"): (2.0, "abcd", False),
        ("colors", "bfloat16"): (1.9, "axcd", False),
        ("colors", "unorm8"): (2.1, "xbcd", False),
        ("points", "float8"): (2.0, "abcd", True),
        **{("times", form): (3.0, "xxxx", False) for form in KEPT["tsar"]["times"]},
    }
    formats = format_table(run_table(results(OPTIONS, of)), 0.01)
    safe = least_safe(formats).set_index("kept")
    assert safe.loc["colors", "format"] == "bfloat16" and safe.loc["colors", "change"] == pytest.approx(0.95)
    assert safe.loc["points", "format"] in ("bfloat16", "float16"), "invariants broke in fewer bits"
    assert safe.loc["times", "format"] == ""
    line = formats[(formats["kept"] == "colors") & (formats["format"] == "unorm8")].iloc[0]
    assert line["first other batch"] == 0 and line["runs alike"] == 0 and line["runs"] == 2 and not line["safe"]
    shown, kept = shown_tables(formats, 0.01)
    assert len(shown.rows) == len(formats) and ["tsar", "times", "none tried", "nan"] in kept.rows


def test_tables_of_nothing_are_empty() -> None:
    formats = format_table(run_table([]), 0.01)
    assert isinstance(formats, pd.DataFrame) and formats.empty and least_safe(formats).empty
    assert [table.rows for table in shown_tables(formats, 0.01)] == [[], []]
