"""Tables from the results of the study of parts. They do not depend on the order of the runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from analysis.ablation.parts import WHOLE
from analysis.ablation.runs import Run
from analysis.metrics.arrays import Floats
from analysis.metrics.budget import SHARES
from analysis.metrics.rivals import BEST, best_of
from analysis.study.inputs import ALL, by_number


@dataclass(frozen=True)
class RunResult:
    """A run as read from disk: its place in the study, and its table over the reference times."""

    run: Run
    times: pd.DataFrame


def moment_table(results: Iterable[RunResult], rivals: Sequence[str]) -> pd.DataFrame:
    """A line for each run of the policy and reference time: ``mse``, ``framed``, ``best-rival`` and, for the whole
    policy, the columns ``budget_*``. Runs without their framed renderer are left out."""
    by_place: dict[tuple[int, str, int], dict[str, RunResult]] = {}
    for one in results:
        place = one.run.row, one.run.case.input, one.run.repetition
        by_place.setdefault(place, {})[one.run.label] = one
    numbers = by_number(name for _, name, _ in by_place)
    order = sorted(by_place, key=lambda place: (place[0], numbers.index(place[1]), place[2]))
    lines = []
    for row, name, repetition in order:
        here = by_place[row, name, repetition]
        if "framed" not in here:
            continue
        errors = {label: here[label].times["mse"].to_numpy() for label in rivals if label in here}
        for label, one in here.items():
            if label not in rivals:
                kept = [column for column in one.times if column == "mse" or column.startswith("budget_")]
                found = one.times[["time_s", *kept]].assign(framed=errors["framed"], **{BEST: best_of(errors.values())})
                found.insert(0, "policy", label)
                for column, value in (("repetition", repetition), ("input", name), ("row", row)):
                    found.insert(0, column, value)
                lines.append(found)
    return pd.concat(lines, ignore_index=True) if lines else pd.DataFrame()


def part_table(moments: pd.DataFrame) -> pd.DataFrame:
    """A line for each row, policy and input, and one for all inputs together.

    ``ratio`` is the mean error over that of the framed renderer, means over all moments of all repetitions; ``least``
    and ``most`` are those of single repetitions. ``change`` is the ratio over that of the whole policy. ``at most
    framed`` and ``at most best-rival`` are shares of the moments at which the error is at most the other's. For all
    inputs together ``ratio`` and ``change`` are the geometric means of those of the inputs.
    """
    whole = {place: _ratio(found) for place, found in _whole(moments)}
    lines: list[dict[str, Any]] = []
    for (row, label), of_policy in _groups(moments, ["row", "policy"]):
        own = [_part_line(row, label, str(name), found) for (name,), found in _groups(of_policy, ["input"])]
        for line in own:
            line["change"] = line["ratio"] / whole.get((row, line["input"]), np.nan)
        means = {name: _geometric([line[name] for line in own]) for name in ("ratio", "change")}
        lines += [*own, {"row": row, "policy": label, "input": ALL, **means, **_shares(of_policy)}]
    return pd.DataFrame(lines)


def _part_line(row: int, label: str, name: str, found: pd.DataFrame) -> dict[str, Any]:
    each = [_ratio(one) for _, one in _groups(found, ["repetition"])]
    line = {"row": row, "policy": label, "input": name, "mse": _mean(found, "mse"), "framed": _mean(found, "framed")}
    return {**line, "ratio": _ratio(found), "least": min(each), "most": max(each), **_shares(found)}


def _ratio(found: pd.DataFrame) -> float:
    return _mean(found, "mse") / _mean(found, "framed")


def _mean(found: pd.DataFrame, column: str) -> float:
    return float(found[column].to_numpy().mean())


def _shares(found: pd.DataFrame) -> dict[str, float]:
    return {f"at most {other}": _share_at_most(found, found[other].to_numpy()) for other in ("framed", BEST)}


def _share_at_most(found: pd.DataFrame, errors: Floats) -> float:
    return float((found["mse"].to_numpy() <= errors).mean())


def _geometric(values: Sequence[float]) -> float:
    return float(np.exp(np.mean(np.log(values))))


def budget_table(moments: pd.DataFrame) -> pd.DataFrame:
    """A line for each row and input of the whole policy: means over moments and repetitions, over the mean of framed.

    The shares of the error (:mod:`analysis.metrics.budget`) add up to ``ratio``. ``uncovered`` and ``relit`` are shares
    of the pixels, and ``late_ms`` is the mean age of the time that the display shows.
    """
    return pd.DataFrame(
        [
            {"row": row, "input": name}
            | {share: _over_framed(found, f"budget_{share}") for share in SHARES}
            | {"ratio": _ratio(found)}
            | {place: _mean(found, f"budget_{place}") for place in ("uncovered", "relit")}
            | {"late_ms": 1e3 * _mean(found, "budget_late_s")}
            for (row, name), found in _whole(moments)
        ]
    )


def floor_table(moments: pd.DataFrame) -> pd.DataFrame:
    """A line for each row and input: the errors of the whole policy and of a perfect picture of the same latency (the
    floor), both over that of framed.

    ``policy / floor`` is the ratio of their mean errors, and ``at most twice`` the share of the moments at which the
    error of the policy is at most twice that of the floor.
    """
    return pd.DataFrame(
        [
            {"row": row, "input": name, "floor": _over_framed(found, "budget_floor"), "policy": _ratio(found)}
            | {"policy / floor": _mean(found, "mse") / _mean(found, "budget_floor")}
            | {"at most twice": _share_at_most(found, 2.0 * found["budget_floor"].to_numpy())}
            for (row, name), found in _whole(moments)
        ]
    )


def _over_framed(found: pd.DataFrame, column: str) -> float:
    return _mean(found, column) / _mean(found, "framed")


def _whole(moments: pd.DataFrame) -> list[tuple[tuple[Any, ...], pd.DataFrame]]:
    if moments.empty:
        return []
    return _groups(where(moments, "policy", WHOLE), ["row", "input"])


def _groups(frame: pd.DataFrame, by: list[str]) -> list[tuple[tuple[Any, ...], pd.DataFrame]]:
    """Groups in the order of the frame's lines."""
    if frame.empty:
        return []
    found: Any = frame.groupby(by, sort=False)
    return list(found)


def where(frame: pd.DataFrame, column: str, value: object) -> pd.DataFrame:
    """The lines with a given value in a column; a frame without lines may have no columns."""
    found: Any = frame[frame[column] == value] if len(frame) else frame
    return found


def by_input(parts: pd.DataFrame, column: str, row: int) -> dict[str, dict[str, float]]:
    """A column of the table of parts at a row: for each policy its values by input, with :data:`ALL` last."""
    return {
        str(label): dict(zip(found["input"].tolist(), found[column].tolist(), strict=True))
        for (label,), found in _groups(where(parts, "row", row), ["policy"])
    }
