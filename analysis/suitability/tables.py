"""Tables from the results of a suitability study. They do not depend on the order of the runs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from analysis.metrics.arrays import Floats
from analysis.metrics.quality import DRAWS, INTERVAL, ratio, ratio_statistics, suitable_percentile
from analysis.study.cases import ROWS, is_framed
from analysis.study.inputs import INPUTS, by_number
from analysis.study.thesis import SHARES, SUITABLE_PERCENTILE
from analysis.suitability.runs import Run

SIGNS = {"mse": -1, "log_mse": -1, "flip": -1, "ssim": 1, "jod": 1}
"""Metrics by name: 1 if higher is better, -1 if lower is better."""


@dataclass(frozen=True)
class RunResult:
    """A run as read from disk.

    Attributes:
        run: the case and its place in the study.
        summary: measurements of the whole run.
        times: table over the reference times.
    """

    run: Run
    summary: Mapping[str, Any]
    times: pd.DataFrame

    def value(self, metric: str) -> float:
        """A metric of the whole run: the mean over time, or the score of the sequence."""
        if metric == "jod":
            score = self.summary["jod"]
            return math.nan if score is None else float(score)
        return float(np.nanmean(self.times[metric].to_numpy())) if metric in self.times else math.nan


class Results:
    """Results by their place in the study. Failed runs are missing."""

    def __init__(self, results: Sequence[RunResult]) -> None:
        self.all = sorted(results, key=lambda one: (one.run.label, one.run.case.name))
        self._by = {
            (one.run.label, one.run.case.input, one.run.row, one.run.side_px, one.run.repetition): one
            for one in self.all
        }
        self.repetitions = sorted({one.run.repetition for one in self.all})
        self.inputs = by_number(one.run.case.input for one in self.all)
        self.rows = sorted({one.run.row for one in self.all if one.run.label == "thesis" and one.run.row is not None})

    def get(self, label: str, name: str, row: int | None, side_px: int, repetition: int) -> RunResult | None:
        """The result at a place; None if the run failed."""
        return self._by.get((label, name, row, side_px, repetition))

    def pairs(self, name: str, row: int) -> list[tuple[RunResult, RunResult]]:
        """The adaptive run and its framed one, for every repetition that has both."""
        found = []
        for one in self.all:
            if (one.run.label, one.run.case.input, one.run.row) == ("thesis", name, row):
                framed = self.get("framed", name, None, one.run.side_px, one.run.repetition)
                found += [(one, framed)] if framed is not None else []
        return sorted(found, key=lambda pair: pair[0].run.repetition)


def ratios(pair: tuple[RunResult, RunResult]) -> Floats:
    """``mse_adaptive / mse_framed`` at the reference times. Source: Stephens 2011, eq. 7.2."""
    return ratio(pair[0].times["mse"].to_numpy(), pair[1].times["mse"].to_numpy())


def run_table(results: Results) -> pd.DataFrame:
    """One line for each adaptive run: statistics of its ratio, metrics of both renderers, checks."""
    lines = []
    for name, row in itertools.product(results.inputs, results.rows):
        for ours, framed in results.pairs(name, row):
            statistics = ratio_statistics(ours.times["mse"].to_numpy(), framed.times["mse"].to_numpy())
            line = {"input": name, "row": row, "batch": ROWS[row][0], "side": ROWS[row][1]}
            line |= {"repetition": ours.run.repetition, "phase": ours.run.case.phase, "median": statistics.median}
            line |= {"quartile_low": statistics.quartile_low, "quartile_high": statistics.quartile_high}
            line |= {"suitable_percentile": statistics.suitable_percentile, "share_suitable": statistics.share_suitable}
            line |= {"outliers": statistics.outliers, "infinite": statistics.infinite}
            for metric in SIGNS:
                line |= {f"{metric}_thesis": ours.value(metric), f"{metric}_framed": framed.value(metric)}
            # a run too short for a whole cycle has measured neither cycles nor invariants
            line |= {"cycles": ours.summary.get("cycles", 0), "cycle_s": ours.summary.get("cycle_s", math.nan)}
            line |= {"invariants_ok": ours.summary.get("invariants", {"ok": True})["ok"]}
            line |= {"nonfinite": ours.summary["nonfinite_samples"]}
            lines.append(line)
    return pd.DataFrame(lines)


def percentile_table(results: Results) -> pd.DataFrame:
    """Table 7.2: greatest suitable percentile for each row and input, over all repetitions together, and the
    thesis'."""
    lines = []
    for row in results.rows:
        line: dict[str, Any] = {"row": row, "batch": ROWS[row][0], "side": ROWS[row][1]}
        for name in results.inputs:
            pairs = results.pairs(name, row)
            values = [ratios(pair) for pair in pairs]
            each = [suitable_percentile(one) for one in values]
            line[name] = suitable_percentile(np.concatenate(values)) if values else math.nan
            line[f"{name} least"], line[f"{name} most"] = (min(each), max(each)) if each else (math.nan, math.nan)
            line[f"{name} thesis"] = SUITABLE_PERCENTILE[row][INPUTS.index(name)] if name in INPUTS else math.nan
        lines.append(line)
    return pd.DataFrame(lines)


def _shares(percentiles: Floats, suitable: Floats, counts: Floats) -> Floats:
    """The four summary shares, over the last axis of runs."""
    ratios_suitable = suitable.sum(-1) / counts.sum(-1)
    runs = [(percentiles >= bound).mean(-1) for bound in (100.0, 90.0, 50.0)]
    return np.stack([ratios_suitable, *runs], -1)


def share_table(results: Results, seed: int = 0) -> pd.DataFrame:
    """The thesis' summary beside ours, with bootstrap intervals.

    Repetitions, each a seed and a phase, are drawn with replacement for each input. All rows of an input share them,
    because they share the reference. A run of the table is the drawn repetitions of its row, taken together. With one
    repetition there is nothing to draw from, and the interval is empty.
    """
    draws = np.random.default_rng(seed).integers(0, 1 << 30, (DRAWS, len(results.inputs)))
    ours, boot = [], []
    for place, name in enumerate(results.inputs):
        per_row = [[ratios(pair) for pair in results.pairs(name, row)] for row in results.rows]
        per_row = [row for row in per_row if row]
        if not per_row:
            continue
        count = min(len(row) for row in per_row)
        chosen = [tuple(range(count)), *itertools.product(range(count), repeat=count)]
        values = np.array([[_of_run(row, choice) for row in per_row] for choice in chosen])
        ours.append(values[0])
        boot.append(values[1:][draws[:, place] % (len(chosen) - 1)])
    if not ours:
        return pd.DataFrame()
    whole = np.concatenate(ours, 0)
    drawn = np.concatenate(boot, 1)
    found, spread = _shares(*whole.T), _shares(*np.moveaxis(drawn, 2, 0))
    low, high = np.percentile(spread, INTERVAL, axis=0)
    several = len(results.repetitions) > 1
    return pd.DataFrame(
        {
            "share": list(SHARES),
            "thesis": list(SHARES.values()),
            "ours": found,
            "low": low if several else math.nan,
            "high": high if several else math.nan,
        }
    )


def _of_run(row: list[Floats], choice: tuple[int, ...]) -> tuple[float, int, int]:
    together = np.concatenate([row[number] for number in choice])
    return suitable_percentile(together), int((together <= 1.0).sum()), len(together)


def policy_table(results: Results, row: int, side_px: int, seed: int = 0) -> pd.DataFrame:
    """Every policy at one row: error, score, and share of the oracle's gain over the framed renderer.

    ``share = (E_framed - E) / (E_framed - E_oracle)`` of errors averaged over time and repetitions; 1 is the oracle.
    """
    labels = sorted({one.run.label for one in results.all if one.run.row in (row, None) and one.run.side_px == side_px})
    lines = []
    for name in results.inputs:
        errors = {label: _errors(results, label, name, row, side_px) for label in labels}
        framed, oracle = errors.get("framed", {}), errors.get("oracle", {})
        for label in labels:
            both = sorted(set(errors[label]) & set(framed))
            line = {"input": name, "policy": label, "mse": _mean(errors[label], both)}
            line["jod"] = _jod(results, label, name, row, side_px)
            line["ratio"] = _mean(errors[label], both) / _mean(framed, both) if both else math.nan
            known = sorted(set(both) & set(oracle))
            line |= _oracle_share(errors[label], framed, oracle, known, seed)
            lines.append(line)
    return pd.DataFrame(lines)


def _errors(results: Results, label: str, name: str, row: int, side_px: int) -> dict[int, float]:
    """Mean error by repetition."""
    at = None if is_framed(label) else row
    found = {number: results.get(label, name, at, side_px, number) for number in results.repetitions}
    return {number: one.value("mse") for number, one in found.items() if one is not None}


def _jod(results: Results, label: str, name: str, row: int, side_px: int) -> float:
    at = None if is_framed(label) else row
    found = [results.get(label, name, at, side_px, number) for number in results.repetitions]
    scores = [one.value("jod") for one in found if one is not None]
    known = [score for score in scores if not math.isnan(score)]
    return float(np.mean(known)) if known else math.nan


def _mean(errors: Mapping[int, float], numbers: Sequence[int]) -> float:
    return float(np.mean([errors[number] for number in numbers])) if numbers else math.nan


def _oracle_share(
    errors: Mapping[int, float], framed: Mapping[int, float], oracle: Mapping[int, float], known: list[int], seed: int
) -> dict[str, float]:
    if not known:
        return dict.fromkeys(("oracle_share", "oracle_share_low", "oracle_share_high"), math.nan)
    mine, base, best = (np.array([one[number] for number in known]) for one in (errors, framed, oracle))
    drawn = np.random.default_rng(seed).integers(0, len(known), (DRAWS, len(known)))

    def share(pick: Any) -> Any:
        gap = base[pick].mean(-1) - best[pick].mean(-1)
        return (base[pick].mean(-1) - mine[pick].mean(-1)) / gap

    low, high = np.percentile(share(drawn), INTERVAL) if len(known) > 1 else (math.nan, math.nan)
    found = float(share(np.arange(len(known))))
    return {"oracle_share": found, "oracle_share_low": float(low), "oracle_share_high": float(high)}


def disagreement_table(results: Results) -> pd.DataFrame:
    """Runs in which metrics disagree about the better renderer, one line each; +1 means that ``thesis`` is better."""
    lines = []
    for name, row in itertools.product(results.inputs, results.rows):
        for ours, framed in results.pairs(name, row):
            votes = {
                metric: sign * np.sign(ours.value(metric) - framed.value(metric)) for metric, sign in SIGNS.items()
            }
            given = {metric: vote for metric, vote in votes.items() if not np.isnan(vote) and vote != 0}
            if len(set(given.values())) > 1:
                lines.append({"input": name, "row": row, "repetition": ours.run.repetition, **votes})
    return pd.DataFrame(lines, columns=["input", "row", "repetition", *SIGNS])


def vote_table(results: Results) -> pd.DataFrame:
    """Number of runs in which ``thesis`` is better than the framed renderer, by each metric."""
    runs = run_table(results)
    lines = []
    for metric, sign in SIGNS.items() if len(runs) else ():
        gain = sign * (runs[f"{metric}_thesis"] - runs[f"{metric}_framed"]).to_numpy()
        known = ~np.isnan(gain)
        lines.append({"metric": metric, "thesis better": int((gain[known] > 0).sum()), "runs": int(known.sum())})
    return pd.DataFrame(lines, columns=["metric", "thesis better", "runs"])


def rank_table(results: Results) -> pd.DataFrame:
    """Spearman's rank correlation between metrics over all adaptive runs; 1 for equal ranks."""
    runs = run_table(results)
    lines = []
    for one, other in itertools.combinations(SIGNS, 2) if len(runs) else ():
        values = [SIGNS[name] * runs[f"{name}_thesis"].to_numpy() for name in (one, other)]
        known = ~np.isnan(values[0]) & ~np.isnan(values[1])
        found: Any = spearmanr(values[0][known], values[1][known])[0] if known.sum() > 2 else math.nan
        lines.append({"metric": one, "and": other, "rank correlation": float(found), "runs": int(known.sum())})
    return pd.DataFrame(lines, columns=["metric", "and", "rank correlation", "runs"])


def cause_table(results: Results, row: int, side_px: int) -> pd.DataFrame:
    """Causes of the error of every policy at one row, as means over the times at which the truth of all ages is
    known."""
    lines = []
    for name in results.inputs:
        for one in results.all:
            here = one.run.case.input == name and one.run.side_px == side_px and one.run.row in (row, None)
            if here and "aliasing" in one.times:
                lines += _cause_lines(name, one)
    if not lines:
        return pd.DataFrame()
    frame: Any = pd.DataFrame(lines).groupby(["input", "policy"], sort=False, as_index=False)
    return frame.mean()


def region_table(results: Results, row: int, side_px: int) -> pd.DataFrame:
    """Causes of the error of every policy at one row, by region of the picture, as parts of the whole error."""
    lines = []
    for one in results.all:
        if one.run.side_px == side_px and one.run.row in (row, None):
            head = {"input": one.run.case.input, "policy": one.run.label}
            lines += [{**head, "region": region, **found} for region, found in one.summary["regions"].items()]
    if not lines:
        return pd.DataFrame()
    frame: Any = pd.DataFrame(lines).groupby(["input", "policy", "region"], sort=False, as_index=False)
    return frame.mean()


def _cause_lines(name: str, one: RunResult) -> list[dict[str, Any]]:
    known = one.times[one.times["causes_known"] > 0.999]
    if known.empty:
        return []
    line: dict[str, Any] = {"input": name, "policy": one.run.label}
    for cause in ("aliasing", "blur", "lag", "mixed"):
        line[cause] = known[cause].mean()
    return [{**line, "mse": known["causes_mse"].mean(), "flicker": one.times["flicker"].mean(), "times": len(known)}]
