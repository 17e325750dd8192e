"""Policies beside the framed renderer and the best of their rivals, at every row of a suitability study.

Here a run is an input at a row with all repetitions together, as in table 7.2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from analysis.metrics.arrays import Floats
from analysis.metrics.quality import percentile, ratio, suitable_percentile
from analysis.metrics.rivals import BEST, best_of, best_shares, standing
from analysis.study.cases import ROWS, is_framed
from analysis.suitability.tables import SIGNS, Results, RunResult

ALL = "all"
"""Stands in the column of rows for all rows together."""


@dataclass(frozen=True)
class RunGroup:
    """Results of one input, row and repetition, which share the reference.

    Attributes:
        input, row: input and row of table 7.2.
        results: results by policy; failed ones are missing.
    """

    input: str
    row: int
    results: Mapping[str, RunResult]

    def values(self, name: str, metric: str) -> Floats:
        """Values of a metric at the reference times; the score of a sequence is a single value."""
        one = self.results[name]
        if metric in one.times:
            return one.times[metric].to_numpy()
        return np.array([one.value(metric)])

    def best(self, rivals: Iterable[str], metric: str) -> Floats:
        """The best value among the rivals that ran."""
        return best_of([self.values(name, metric) for name in rivals if name in self.results], SIGNS[metric])


def groups_of(results: Results, rows: Mapping[int, int], names: Sequence[str]) -> list[RunGroup]:
    """Groups of the results of some policies, if the framed renderer has a result.

    Args:
        results: results of the study.
        rows: side of the image by row, pixels.
        names: names of the policies.
    """
    found = []
    for row, side in rows.items():
        for name in results.inputs:
            for repetition in results.repetitions:
                made = {one: results.get(one, name, None if is_framed(one) else row, side, repetition) for one in names}
                present = {one: result for one, result in made.items() if result is not None}
                if "framed" in present:
                    found.append(RunGroup(name, row, present))
    return found


def _by_row(groups: Sequence[RunGroup]) -> Iterator[tuple[int | str, list[RunGroup]]]:
    rows = sorted({group.row for group in groups})
    if len(rows) > 1:
        yield ALL, list(groups)
    yield from ((row, [group for group in groups if group.row == row]) for row in rows)


def rival_table(groups: Sequence[RunGroup], policies: Sequence[str], rivals: Sequence[str]) -> pd.DataFrame:
    """A line for each row and policy: its error compared with that of the framed renderer and of the best rival.

    ``at most`` is the share of moments at which the error is at most the other's, and ``median`` the median of the
    ratio. ``always`` and ``90 %`` count the runs in which it is at most the other's at all times, and at 90 % of the
    time by the greatest suitable percentile. ``worst`` is the greatest median of a run. A policy that is itself a rival
    is compared with the best of all rivals, including itself.
    """
    lines = []
    for row, found in _by_row(groups):
        for name in policies:
            here = [group for group in found if name in group.results]
            if not here:
                continue
            setting = "" if row == ALL else f"{ROWS[int(row)][0]}, {ROWS[int(row)][1]}²"
            line: dict[str, Any] = {"row": str(row), "setting": setting, "policy": name}
            line["runs"] = len({(group.input, group.row) for group in here})
            for label, others in (("framed", ["framed"]), (BEST, rivals)):
                line |= {f"{label}: {key}": value for key, value in _beside(here, name, others).items()}
            lines.append(line)
    return pd.DataFrame(lines)


def _beside(groups: Sequence[RunGroup], name: str, others: Sequence[str]) -> dict[str, float]:
    """Statistics of the error of a policy over the least error of the others."""
    of_run: dict[tuple[str, int], list[Floats]] = {}
    for group in groups:
        ratios = ratio(group.values(name, "mse"), group.best(others, "mse"))
        of_run.setdefault((group.input, group.row), []).append(ratios)
    together = [np.concatenate(ratios) for ratios in of_run.values()]
    everything = np.concatenate(together)
    percentiles = np.array([suitable_percentile(ratios) for ratios in together])
    return {
        "at most": float((everything <= 1.0).mean()),
        "median": percentile(np.sort(everything), 50.0),
        "always": int((percentiles >= 100.0).sum()),
        "90 %": int((percentiles >= 90.0).sum()),
        "worst": max(percentile(np.sort(ratios), 50.0) for ratios in together),
    }


def metric_table(groups: Sequence[RunGroup], policies: Sequence[str], rivals: Sequence[str]) -> pd.DataFrame:
    """Policies by every metric, all rows together: share of moments, and number of runs in which the mean is better.

    The score of a sequence counts as one moment.
    """
    lines = []
    for name in policies:
        others_than = [one for one in rivals if one != name]
        here = [group for group in groups if name in group.results and any(one in group.results for one in others_than)]
        for metric, sign in SIGNS.items() if here else ():
            line: dict[str, Any] = {"policy": name, "metric": metric}
            for label, others in (("framed", ["framed"]), (BEST, others_than)):
                own = np.concatenate([group.values(name, metric) for group in here])
                other = np.concatenate([group.best(others, metric) for group in here])
                found = standing(own, other, sign)
                better, known = _better_runs(here, name, others, metric)
                line |= {f"{label}: at least as good": found.share, f"{label}: ratio of medians": found.ratio}
                line |= {f"{label}: runs better": better, f"{label}: runs": known}
            lines.append(line)
    return pd.DataFrame(lines)


def _better_runs(groups: Sequence[RunGroup], name: str, others: Sequence[str], metric: str) -> tuple[int, int]:
    """Number of runs in which the mean is better than that of every other, and number of runs with a value."""
    sign, means = SIGNS[metric], dict[tuple[str, int], list[tuple[float, float]]]()
    for group in groups:
        own = group.results[name].value(metric)
        values = [sign * group.results[one].value(metric) for one in others if one in group.results]
        values = [value for value in values if not math.isnan(value)]
        if values and not math.isnan(own):
            means.setdefault((group.input, group.row), []).append((sign * own, max(values)))
    pairs = [np.mean(found, axis=0) for found in means.values()]
    return sum(bool(own > other) for own, other in pairs), len(pairs)


def lead_table(groups: Sequence[RunGroup], rivals: Sequence[str]) -> pd.DataFrame:
    """A line for each row: share of the moments at which each rival has the lowest error; equal ones all count."""
    lines = []
    for row, found in _by_row(groups):
        shares = []
        for group in found:
            errors = {name: group.values(name, "mse") for name in rivals if name in group.results}
            shares.append(best_shares(errors))
        names = [name for name in rivals if any(name in share for share in shares)]
        lines.append({"row": str(row)} | {name: float(np.mean([s.get(name, 0.0) for s in shares])) for name in names})
    return pd.DataFrame(lines)
