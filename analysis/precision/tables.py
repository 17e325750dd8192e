"""Tables from the results of the study of precision. They do not depend on the order of the runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from analysis.command.console import Table
from analysis.precision.runs import OWN, Run

BITS = {"float64": 64, "float32": 32, "bfloat16": 16, "float16": 16, "float8": 8, "unorm8": 8}


@dataclass(frozen=True)
class RunResult:
    """A run as read from disk.

    Attributes:
        run: its place in the study.
        mse: mean over the reference times.
        asked: a hash of each requested batch, including throw-away ones and the warm-up.
        broken: whether a cycle broke an invariant.
    """

    run: Run
    mse: float
    asked: Sequence[str]
    broken: bool = False


def same_for(asked: Sequence[str], others: Sequence[str]) -> int:
    """Number of equal batches that two runs request before the first that differs."""
    for number, (one, other) in enumerate(zip(asked, others, strict=False)):
        if one != other:
            return number
    return min(len(asked), len(others))


def run_table(results: Iterable[RunResult]) -> pd.DataFrame:
    """A line for each run in another format: its error over that of the unchanged policy, and the number of batches
    before their requests differ. Runs whose counterpart is missing are left out."""
    results = list(results)
    own = {_place(one.run): one for one in results if one.run.form == OWN}
    lines = []
    for one in results:
        run, beside = one.run, own.get(_place(one.run))
        if run.form == OWN or beside is None:
            continue
        lines.append({
            "policy": run.policy,
            "kept": run.kept,
            "format": run.form,
            "bits": BITS[run.form],
            "input": run.case.input,
            "repetition": run.repetition,
            "mse": one.mse,
            "change": one.mse / beside.mse,
            "batches alike": same_for(one.asked, beside.asked),
            "batches": len(beside.asked),
            "broken": one.broken,
        })  # fmt: skip
    return pd.DataFrame(lines)


def _place(run: Run) -> tuple[str, str, int]:
    return run.policy, run.case.input, run.repetition


def format_table(lines: pd.DataFrame, tolerance: float) -> pd.DataFrame:
    """A line for each policy, kind of value and format: ``change`` is the geometric mean over all runs, ``least`` and
    ``most`` are those of single runs; ``safe`` means that ``change`` is at most ``1 + tolerance`` and no invariant
    broke."""
    found = []
    groups: Any = lines.groupby(["policy", "kept", "format"], sort=False) if len(lines) else ()
    for (policy, kept, form), group in groups:
        change = float(np.exp(np.log(group["change"]).mean()))
        found.append({
            "policy": policy,
            "kept": kept,
            "format": form,
            "bits": BITS[form],
            "change": change,
            "least": float(group["change"].min()),
            "most": float(group["change"].max()),
            "runs alike": int((group["batches alike"] == group["batches"]).sum()),
            "first other batch": int(group["batches alike"].min()),
            "runs": len(group),
            "broken": int(group["broken"].sum()),
            "safe": bool(change <= 1.0 + tolerance and not group["broken"].any()),
        })  # fmt: skip
    return pd.DataFrame(found)


def least_safe(formats: pd.DataFrame) -> pd.DataFrame:
    """A line for each policy and kind of value: the safe format of fewest bits and, among several, of least error;
    empty if none of the formats tried is safe."""
    found = []
    groups: Any = formats.groupby(["policy", "kept"], sort=False) if len(formats) else ()
    for (policy, kept), group in groups:
        safe = group[group["safe"]].sort_values(["bits", "change"], kind="stable")
        form, change = (safe["format"].iloc[0], safe["change"].iloc[0]) if len(safe) else ("", np.nan)
        found.append({"policy": policy, "kept": kept, "format": form, "change": change})
    return pd.DataFrame(found)


def shown_tables(formats: pd.DataFrame, tolerance: float) -> list[Table]:
    """The tables as text."""
    rows = [
        [
            line["policy"],
            line["kept"],
            line["format"],
            f"{line['change']:.3f}",
            f"{line['least']:.3f}–{line['most']:.3f}",
            "never" if line["runs alike"] == line["runs"] else f"{line['first other batch']:,}",
            f"{line['runs alike']} of {line['runs']}",
            f"{line['broken']} of {line['runs']}",
        ]
        for line in formats.to_dict("records")
    ]
    header = [
        "policy",
        "kept",
        "format",
        "error",
        "of single runs",
        "first other batch",
        "same batches",
        "broke invariants",
    ]
    safe = [
        [line["policy"], line["kept"], line["format"] or "none tried", f"{line['change']:.3f}"]
        for line in least_safe(formats).to_dict("records")
    ]
    title = f"The format of fewest bits whose error is greater by at most {100.0 * tolerance:g} %"
    return [
        Table("Mean error over that of the unchanged policy, and the first batch that differs", header, rows),
        Table(title, ["policy", "kept", "format", "error"], safe),
    ]
