"""From trials to just-noticeable differences, comparisons and power."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Int
from numpy.typing import NDArray

from analysis.perception.peer import peer_fit
from analysis.perception.psychometrics import (
    TWO_ALTERNATIVES,
    FitError,
    Rule,
    correct_share,
    fit,
    paired,
    threshold_samples,
)
from analysis.perception.trials import CONDITIONS

THESIS_JND = {"planescene": 40.0, "spheresscene": 100.0}
"""Just-noticeable differences, samples per pixel, read off figures 19 and 20 of the thesis."""

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


def fits(
    trials: pd.DataFrame, bootstraps: int, seed: int, peer: bool = False, rule: Rule = TWO_ALTERNATIVES
) -> pd.DataFrame:
    """Fits by scene, by scene and filter, by set and filter, and by all three; one row a fit.

    Args:
        trials: answered trials.
        bootstraps, seed: number of bootstrap data sets of each interval, and their seed.
        peer: whether psignifit also fits the data.
        rule: guess rate and threshold.
    """
    rows = []
    for keys in _GROUPS:
        for values in pd.DataFrame(trials, columns=list(keys)).drop_duplicates().to_dict("records"):
            same = np.all([trials[str(key)] == value for key, value in values.items()], axis=0)
            rows.append({**values, **fit_row(trials.loc[same], bootstraps, seed, peer, rule)})
    return pd.DataFrame(rows)


def fit_row(
    part: pd.DataFrame, bootstraps: int, seed: int, peer: bool = False, rule: Rule = TWO_ALTERNATIVES
) -> dict[str, Any]:
    """One fit as a row; if it fails, the reason in place of the numbers."""
    levels, correct, asked = counts(part)
    try:
        found = fit(levels.tolist(), correct, asked, bootstraps, seed, rule)
    except FitError as error:
        return {"status": str(error), "trials": len(part), "observers": part["observer"].nunique()}
    low, high = found.interval or (np.nan, np.nan)
    beside = {}
    if peer and found.status == "within":
        other = peer_fit(levels.tolist(), correct.sum(axis=0).tolist(), asked.sum(axis=0).tolist())
        beside = {"psignifit_jnd": other.jnd, "psignifit_low": other.interval[0], "psignifit_high": other.interval[1]}
    return {
        **beside,
        "jnd": found.jnd, "low": low, "high": high, "status": found.status, "mu": found.mu, "sigma": found.sigma,
        "lapse": found.lapse, "trials": found.trials, "observers": part["observer"].nunique(),
    }  # fmt: skip


def counts(
    part: pd.DataFrame,
) -> tuple[NDArray[np.int64], Int[NDArray[np.int64], "observers levels"], Int[NDArray[np.int64], "observers levels"]]:
    """Levels, and the numbers of right answers and of answers of every observer at each."""
    levels, level = np.unique(np.asarray(part["samples"], np.int64), return_inverse=True)
    names, person = np.unique(np.asarray(part["observer"], str), return_inverse=True)
    shape = len(names), len(levels)
    right = np.zeros(shape, np.int64)
    asked = np.zeros(shape, np.int64)
    np.add.at(asked, (person, level), 1)
    np.add.at(right, (person, level), np.asarray(part["correct"], bool).astype(np.int64))
    return levels, right, asked


_TESTED = (
    "of", "first", "second", "samples", "pairs", "t", "degrees", "p", "mean_difference", "thesis_p",
)  # fmt: skip
_STRONGEST = ("of", "first", "second", "samples", "t", "degrees", "p", "mean_difference", "levels", "corrected_p")


def comparisons(trials: pd.DataFrame) -> pd.DataFrame:
    """Paired t-tests at each level, of scenes, of sets and of filters, with one entry per observer.

    An entry is the mean over the cells that both conditions have, such as sets and filters if scenes are compared.
    The table is empty if there is one condition of each kind. ``pairs`` counts observers.

    Deviation: the thesis counts every combination of observer, set and filter as a separate entry. The answers of one
    observer are correlated, so such tests of equal conditions find too many differences.
    """
    rows = []
    for column in CONDITIONS:
        others = [name for name in CONDITIONS if name != column]
        shares = trials.pivot_table("correct", [column, "observer", *others], "samples")
        for first, second in itertools.combinations(sorted(set(trials[column])), 2):
            for samples in sorted(trials["samples"].unique()):
                both = _by_observer(shares, first, second, samples)
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
    """For each pair of conditions the level with the smallest p, and that p times the number of compared levels
    (Bonferroni), at most 1.
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


def _by_observer(shares: pd.DataFrame, first: str, second: str, samples: float) -> NDArray[np.float64]:
    """Shares ``(observers, 2)`` of two conditions at one level, as means over the cells that have both."""
    both: list[dict[Any, Any]] = [dict(shares[samples].xs(name).dropna().items()) for name in (first, second)]
    found: dict[str, list[tuple[float, float]]] = {}
    for cell in both[0]:
        if cell in both[1]:  # columns of the observer, and of the other conditions
            found.setdefault(cell[0], []).append((float(both[0][cell]), float(both[1][cell])))
    return np.array([np.mean(entries, axis=0) for entries in found.values()]).reshape(-1, 2)


def recovery(
    levels: Sequence[int],
    jnd: float,
    sigma: float,
    lapse: float,
    spread: float,
    people: tuple[int, int],
    experiments: int,
    bootstraps: int,
    seed: int,
    advance: Callable[[], object] = lambda: None,
) -> dict[str, Any]:
    """How well fits recover a known threshold of observers that differ.

    Args:
        levels: samples per pixel.
        jnd, sigma, lapse: threshold of the mean of all observers' functions; width in octaves and lapse rate of each.
        spread: standard deviation of the observers' thresholds, octaves; every experiment draws new observers.
        people: number of observers, and of answers of each at each level.
        experiments: number of simulated studies.
        bootstraps: bootstrap data sets of each interval.
        seed: seed of all random numbers.
        advance: called after each study.

    Returns:
        The share of intervals that contain the threshold, with Wilson's 95 % interval of that share; the median of the
        fitted thresholds over the true one; and the median ratio of the intervals' upper to their lower ends.
    """
    from scipy.stats import binomtest

    mu = population_mu(jnd, sigma, lapse, spread)
    asked = np.full((people[0], len(levels)), people[1])
    held, ratios, widths = 0, [], []
    for number in range(experiments):
        rng = np.random.default_rng([seed, number])
        share = _shares_of(rng.normal(mu, spread, people[0]), levels, sigma, lapse)
        found = fit(levels, rng.binomial(asked, share), asked, bootstraps, seed + number)
        low, high = found.interval or (0.0, np.inf)
        held += low <= jnd <= high
        ratios.append(found.jnd / jnd)
        widths.append(high / max(low, 1e-9))
        advance()
    between = binomtest(held, experiments).proportion_ci(method="wilson")
    return {
        "jnd": jnd, "sigma": sigma, "lapse": lapse, "spread": spread, "coverage": held / experiments,
        "coverage_low": between.low, "coverage_high": between.high, "jnd_ratio_median": float(np.median(ratios)),
        "interval_ratio_median": float(np.median(widths)),
    }  # fmt: skip


def population_mu(jnd: float, sigma: float, lapse: float, spread: float) -> float:
    """Mean ``μ`` of observers whose mean function, of width ``√(σ² + spread²)``, has the threshold ``jnd``."""
    return float(np.log2(jnd) - np.log2(threshold_samples(0.0, float(np.hypot(sigma, spread)), lapse)))


def _shares_of(
    mus: NDArray[np.float64], levels: Sequence[int], sigma: float, lapse: float
) -> Float[NDArray[np.float64], "observers levels"]:
    x = np.asarray(levels, np.float64)
    return np.stack([correct_share(x, float(mu), sigma, lapse) for mu in mus])


def power(
    levels: Sequence[int],
    jnds: tuple[float, float],
    sigma: float,
    observers: Sequence[int],
    repetitions: Sequence[int],
    experiments: int,
    seed: int,
    spread: float = 0.0,
) -> pd.DataFrame:
    """Share of experiments that distinguish two conditions of given thresholds, by observers and answers per level.

    Two conditions count as distinguished if the 95 % intervals of their thresholds, from equally many answers of the
    same observers, do not overlap.

    Args:
        levels: samples per pixel.
        jnds: true thresholds.
        sigma: width of both functions, octaves.
        observers, repetitions: numbers of observers, and of answers per level, to tabulate.
        experiments: number of simulated experiments for each cell.
        seed: seed of the experiments.
        spread: standard deviation of the observers' thresholds, octaves.
    """
    rows = []
    for people, answers in itertools.product(observers, repetitions):
        rng = np.random.default_rng([seed, people, answers])
        asked = np.full((people, len(levels)), answers)
        apart, widths = 0, []
        for number in range(experiments):
            away = rng.normal(0.0, spread, people)
            shares = [_shares_of(np.log2(jnd) + away, levels, sigma, 0.0) for jnd in jnds]
            found = [fit(levels, rng.binomial(asked, share), asked, 100, number) for share in shares]
            (low_a, high_a), (low_b, high_b) = (one.interval or (0.0, np.inf) for one in found)
            apart += high_a < low_b or high_b < low_a
            widths.append(high_a / max(low_a, 1e-9))
        rows.append(
            {"observers": people, "answers_per_level": answers, "told_apart": apart / experiments,
             "interval_ratio_median": float(np.median(widths))}
        )  # fmt: skip
    return pd.DataFrame(rows)
