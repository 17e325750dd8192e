"""From trials to just-noticeable differences, comparisons and power."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.perception.peer import peer_fit
from analysis.perception.psychometrics import FitError, correct_share, fit, paired, threshold_samples
from analysis.perception.trials import CONDITIONS

THESIS_JND = {"planescene": 40.0, "spheresscene": 100.0}
"""Samples per pixel, read off figures 19 and 20 of the thesis."""

THESIS_P = {
    ("planescene", "spheresscene"): {27: 0.0027, 64: 0.000025, 125: 0.1296, 216: 0.0477},
    ("hammersley", "stratified"): {27: 0.2141, 64: 0.2492, 125: 0.5190},
    ("hammersley", "poisson"): {27: 0.8252, 64: 0.6810, 125: 0.8805},
    ("stratified", "poisson"): {27: 0.4194, 64: 0.2967, 125: 0.6513},
}
"""p values of tables 1 and 2 of the thesis."""


_GROUPS = (
    ("scene",),
    ("scene", "time_filter"),
    ("point_set", "time_filter"),
    ("scene", "point_set", "time_filter"),
)


def fits(trials: pd.DataFrame, bootstraps: int, seed: int, peer: bool = False) -> pd.DataFrame:
    """Fits by scene, by scene and filter, by set and filter, and by all three; a row each.

    Args:
        trials: answered.
        bootstraps, seed: of the intervals.
        peer: whether psignifit fits the same data too.
    """
    rows = []
    for keys in _GROUPS:
        for values in pd.DataFrame(trials, columns=list(keys)).drop_duplicates().to_dict("records"):
            same = np.all([trials[str(key)] == value for key, value in values.items()], axis=0)
            rows.append({**values, **fit_row(trials.loc[same], bootstraps, seed, peer)})
    return pd.DataFrame(rows)


def fit_row(part: pd.DataFrame, bootstraps: int, seed: int, peer: bool = False) -> dict[str, Any]:
    """One fit as a row; a reason instead of numbers where there is none."""
    samples, right = np.asarray(part["samples"], np.int64), np.asarray(part["correct"], bool)
    levels = np.unique(samples)
    asked = [int((samples == level).sum()) for level in levels]
    correct = [int(right[samples == level].sum()) for level in levels]
    try:
        found = fit(levels.tolist(), correct, asked, bootstraps, seed)
    except FitError as error:
        return {"status": str(error), "trials": len(part), "observers": part["observer"].nunique()}
    low, high = found.interval or (np.nan, np.nan)
    beside = {}
    if peer and found.status == "within":
        other = peer_fit(levels.tolist(), correct, asked)
        beside = {"psignifit_jnd": other.jnd, "psignifit_low": other.interval[0], "psignifit_high": other.interval[1]}
    return {
        **beside,
        "jnd": found.jnd, "low": low, "high": high, "status": found.status, "mu": found.mu, "sigma": found.sigma,
        "lapse": found.lapse, "trials": found.trials, "observers": part["observer"].nunique(),
    }  # fmt: skip


_TESTED = (
    "of", "first", "second", "samples", "pairs", "t", "degrees", "p", "mean_difference", "thesis_p",
)  # fmt: skip
_STRONGEST = ("of", "first", "second", "samples", "t", "degrees", "p", "mean_difference", "levels", "corrected_p")


def comparisons(trials: pd.DataFrame) -> pd.DataFrame:
    """Paired t-tests level by level: of scenes over observers, sets and filters, of sets over observers, scenes and
    filters, of filters over observers, scenes and sets. No rows where there is one of each.
    """
    rows = []
    for column in CONDITIONS:
        others = [name for name in CONDITIONS if name != column]
        shares = trials.pivot_table("correct", [column, "observer", *others], "samples")
        for first, second in itertools.combinations(sorted(set(trials[column])), 2):
            for samples in sorted(trials["samples"].unique()):
                both = _side_by_side(shares, first, second, samples)
                found = paired(*both.T.tolist()) if len(both) else None
                expected = THESIS_P.get((first, second), THESIS_P.get((second, first), {}))
                rows.append(
                    {
                        "of": column, "first": first, "second": second, "samples": samples, "pairs": len(both),
                        "t": found.t if found else np.nan, "degrees": found.degrees if found else np.nan,
                        "p": found.p if found else np.nan,
                        "mean_difference": found.mean_difference if found else np.nan,
                        "thesis_p": expected.get(int(samples), np.nan),
                    }
                )  # fmt: skip
    return pd.DataFrame(rows, columns=list(_TESTED))


def strongest(tested: pd.DataFrame) -> pd.DataFrame:
    """Of each pair of conditions the level where they differ most clearly, and its p times the number of levels
    compared (Bonferroni), at most 1.
    """
    rows = []
    asked = tested.loc[tested["p"].notna()]
    for pair, part in asked.groupby(["of", "first", "second"], sort=False):
        best = part.loc[part["p"].idxmin()]
        row = {name: best[name] for name in ("samples", "t", "degrees", "p", "mean_difference")}
        corrected = min(1.0, float(best["p"]) * len(part))
        names = dict(zip(("of", "first", "second"), np.atleast_1d(np.asarray(pair)).tolist(), strict=True))
        rows.append({**names, **row, "levels": len(part), "corrected_p": corrected})
    return pd.DataFrame(rows, columns=list(_STRONGEST))


def _side_by_side(shares: pd.DataFrame, first: str, second: str, samples: float) -> NDArray[np.float64]:
    """Shares ``(cells, 2)`` of two conditions at one level, for the cells that have both."""
    found = [dict(shares[samples].xs(name).dropna().items()) for name in (first, second)]
    return np.array([(found[0][cell], found[1][cell]) for cell in found[0] if cell in found[1]]).reshape(-1, 2)


def recovery(
    levels: Sequence[int],
    jnd: float,
    sigma: float,
    lapse: float,
    trials: int,
    experiments: int,
    bootstraps: int,
    seed: int,
) -> dict[str, Any]:
    """How well fits give back a known threshold.

    Args:
        levels: samples per pixel.
        jnd, sigma, lapse: of the true function: threshold, width in octaves, lapse rate.
        trials: answers at each level.
        experiments: studies simulated.
        bootstraps: of each interval.
        seed: of all.

    Returns:
        The share of intervals that hold the threshold, with Wilson's 95 % interval of that share; the median of the
        fitted thresholds over the true one, and that of the intervals' upper over their lower ends.
    """
    from scipy.stats import binomtest

    mu = np.log2(jnd) - np.log2(threshold_samples(0.0, sigma, lapse))
    share = correct_share(np.asarray(levels, np.float64), mu, sigma, lapse)
    asked = [trials] * len(levels)
    held, ratios, widths = 0, [], []
    for number in range(experiments):
        drawn = np.random.default_rng([seed, number]).binomial(trials, share).tolist()
        found = fit(levels, drawn, asked, bootstraps, seed + number)
        low, high = found.interval or (0.0, np.inf)
        held += low <= jnd <= high
        ratios.append(found.jnd / jnd)
        widths.append(high / max(low, 1e-9))
    between = binomtest(held, experiments).proportion_ci(method="wilson")
    return {
        "jnd": jnd, "sigma": sigma, "lapse": lapse, "coverage": held / experiments, "coverage_low": between.low,
        "coverage_high": between.high, "jnd_ratio_median": float(np.median(ratios)),
        "interval_ratio_median": float(np.median(widths)),
    }  # fmt: skip


def power(
    levels: Sequence[int],
    jnds: tuple[float, float],
    sigma: float,
    observers: Sequence[int],
    repetitions: Sequence[int],
    experiments: int,
    seed: int,
) -> pd.DataFrame:
    """How often two conditions of given thresholds are told apart, by observers and answers per level.

    Two conditions count as told apart where the 95 % intervals of their thresholds, from as many answers, do not
    overlap. Observers are taken to be alike, so this is the best that can be hoped for.

    Args:
        levels: samples per pixel.
        jnds: true thresholds.
        sigma: width of both functions, octaves.
        observers, repetitions: numbers to tabulate.
        experiments: simulated for each cell.
        seed: of those.
    """
    rows = []
    x = np.asarray(levels, np.float64)
    for people, answers in itertools.product(observers, repetitions):
        rng = np.random.default_rng([seed, people, answers])
        trials = np.full(len(x), people * answers)
        apart, widths = 0, []
        for number in range(experiments):
            found = [
                fit(levels, rng.binomial(trials, correct_share(x, np.log2(jnd), sigma, 0.0)).tolist(), trials.tolist(),
                    100, number) for jnd in jnds
            ]  # fmt: skip
            (low_a, high_a), (low_b, high_b) = (one.interval or (0.0, np.inf) for one in found)
            apart += high_a < low_b or high_b < low_a
            widths.append(high_a / max(low_a, 1e-9))
        rows.append(
            {"observers": people, "answers_per_level": answers, "told_apart": apart / experiments,
             "interval_ratio_median": float(np.median(widths))}
        )  # fmt: skip
    return pd.DataFrame(rows)
