"""Psychometric functions of the number of samples: fits, just-noticeable differences, intervals, t-tests, power.

The share of correct answers falls with the samples per pixel ``n`` from nearly 1 to the guess rate:
``p(n) = γ + (1 - γ - λ) Φ((μ - log2 n) / σ)``. The guess rate ``γ`` is 1/2 for two alternatives. The just-noticeable
difference is the ``n`` at which ``p`` is the threshold, by default 0.75.

Observers differ, and the answers of one observer are correlated. So intervals resample observers, and tests count one
entry per observer.

Source: motion-blur perception thesis, chapter 5; Wichmann and Hill 2001, "The psychometric function"; Hesterberg 2015,
"What teachers should know about the bootstrap" (the expanded percentile interval).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray
from scipy import optimize, stats

from tsar.checks import require

GUESS = 0.5
THRESHOLD = 0.75
LAPSE_MAX = 0.08
"""Greatest lapse rate of a fit; functions with this rate still reach the threshold."""

_OCTAVES_BEYOND = 2.0  # octaves by which a fitted μ may lie beyond the levels
_SIGMA_LIMITS = 0.25, 6.0
_GRID = 161, 25, 5


@dataclass(frozen=True)
class Rule:
    """What a task asks for.

    Attributes:
        guess: share of right answers by chance.
        threshold: share of right answers at the just-noticeable difference.
    """

    guess: float = GUESS
    threshold: float = THRESHOLD

    def __post_init__(self) -> None:
        require(0.0 <= self.guess < 1.0 - LAPSE_MAX, "guess_rate", f"in [0, {1.0 - LAPSE_MAX:g})", self.guess)
        reached = self.guess < self.threshold < 1.0 - LAPSE_MAX
        require(reached, "threshold", f"between the guess rate and {1.0 - LAPSE_MAX:g}", self.threshold)


TWO_ALTERNATIVES = Rule()


class FitError(ValueError):
    """Data to which no psychometric function can be fitted; the message says what was expected."""


@dataclass(frozen=True)
class Fit:
    """A fitted function.

    Attributes:
        mu: log2 of the samples at which the lapse-free function is halfway between the guess rate and 1.
        sigma: width, octaves.
        lapse: rate of answers that do not depend on the stimulus.
        jnd: samples per pixel at the threshold; infinite if it lies above the levels, 0 if below.
        interval: 95 % interval of ``jnd`` from a bootstrap, which contains ``jnd``; None without a bootstrap.
        status: ``within`` the levels, ``above`` or ``below`` them.
        log_likelihood: logarithm of the likelihood of the data.
        trials: number of answers.
    """

    mu: float
    sigma: float
    lapse: float
    jnd: float
    interval: tuple[float, float] | None
    status: str
    log_likelihood: float
    trials: int


def correct_share(
    samples: Float[NDArray[np.float64], "*n"],
    mu: float | Float[NDArray[np.float64], "*n"],
    sigma: float,
    lapse: float,
    guess: float = GUESS,
) -> Float[NDArray[np.float64], "*n"]:
    """Probability ``γ + (1 - γ - λ) Φ((μ - log2 n) / σ)`` of a correct answer at ``samples`` per pixel."""
    return guess + (1.0 - guess - lapse) * stats.norm.cdf((mu - np.log2(samples)) / sigma)


def threshold_samples(mu: float, sigma: float, lapse: float, rule: Rule = TWO_ALTERNATIVES) -> float:
    """Samples per pixel at which a function crosses the threshold."""
    return float(2.0 ** _threshold_octaves(mu, sigma, lapse, rule))


def _threshold_octaves(mu: Any, sigma: Any, lapse: Any, rule: Rule) -> Any:
    """Base-two logarithm of that number of samples."""
    return mu - sigma * stats.norm.ppf((rule.threshold - rule.guess) / (1.0 - rule.guess - lapse))


def fit(
    levels: Sequence[float],
    correct: Sequence[int] | Int[NDArray[np.int64], "observers levels"],
    trials: Sequence[int] | Int[NDArray[np.int64], "observers levels"],
    bootstraps: int = 0,
    seed: int = 0,
    rule: Rule = TWO_ALTERNATIVES,
) -> Fit:
    """Fits the answers of all observers together, by maximum likelihood.

    The interval is that of a bootstrap over observers: each data set has the same number of observers, drawn with
    replacement, each with all of its answers. Its percentiles are expanded as far as those of Student's distribution
    lie beyond those of the normal one, because a bootstrap of few observers is too narrow. With one observer, answers
    are drawn from the fit: such an interval says nothing about other observers.

    Args:
        levels: samples per pixel.
        correct, trials: numbers of right answers, and of answers, at each level; one row per observer if there are
            several.
        bootstraps: number of data sets that are drawn for the interval; 0 leaves it out.
        seed: seed of these data sets.
        rule: guess rate and threshold.

    Raises:
        FitError: fewer than two levels with answers, more right answers than answers, or a level below 1.
    """
    x, by_observer, asked = _checked(levels, correct, trials)
    k, n = by_observer.sum(axis=0), asked.sum(axis=0)
    grid = _grid(tuple(x), rule.guess)
    mu, sigma, lapse = _polished(x, k, n, *_best(grid, k[None], n[None])[0], guess=rule.guess)
    jnd, status = _placed(threshold_samples(mu, sigma, lapse, rule), x)
    share = np.clip(correct_share(x, mu, sigma, lapse, rule.guess), 1e-9, 1.0 - 1e-9)
    log_likelihood = float((k * np.log(share) + (n - k) * np.log1p(-share)).sum())
    interval = None
    if bootstraps:
        people = int((asked.sum(axis=1) > 0).sum())
        rng = np.random.default_rng(seed)
        if people > 1:
            chosen = rng.multinomial(len(asked), np.full(len(asked), 1.0 / len(asked)), bootstraps)
            drawn, counts = chosen @ by_observer, chosen @ asked
        else:
            drawn = rng.binomial(n, share, (bootstraps, len(x)))
            counts = np.broadcast_to(n, drawn.shape)
        found = _best(grid, drawn, counts)
        jnds = np.array([_placed(2.0**octaves, x)[0] for octaves in _threshold_octaves(*found.T, rule=rule).tolist()])
        tail = tail_share(people)
        low, high = np.quantile(jnds, [tail, 1.0 - tail], method="nearest")
        interval = min(float(low), jnd), max(float(high), jnd)
    return Fit(mu, sigma, lapse, jnd, interval, status, log_likelihood, int(n.sum()))


def tail_share(observers: int) -> float:
    """Share of a bootstrap's data sets beyond each end of a 95 % interval of ``n`` observers.

    ``Φ(-√(n / (n - 1)) t)``, where ``t`` is the 97.5th percentile of Student's distribution with ``n - 1`` degrees of
    freedom (Hesterberg 2015, sec. 4.3); 0.025 for a single observer.
    """
    if observers < 2:
        return 0.025
    away = math.sqrt(observers / (observers - 1.0)) * stats.t.ppf(0.975, observers - 1.0)
    return float(stats.norm.cdf(-away))


def _checked(
    levels: Sequence[float],
    correct: Sequence[int] | NDArray[np.int64],
    trials: Sequence[int] | NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """The levels that have answers, in order, and their counts ``(observers, levels)``."""
    x, k, n = np.asarray(levels, np.float64), np.asarray(correct, np.int64), np.asarray(trials, np.int64)
    if not x.shape == k.shape[-1:] == n.shape[-1:] or k.shape != n.shape or x.ndim != 1 or k.ndim > 2:
        raise FitError(f"fit: expected as many levels as counts, got {x.shape}, {k.shape} and {n.shape}")
    if (x < 1.0).any() or not np.isfinite(x).all():
        raise FitError(f"fit: expected levels of at least 1 sample, got {x.min()}")
    if (k < 0).any() or (k > n).any():
        raise FitError("fit: expected between 0 and all answers right at every level")
    k, n = np.atleast_2d(k), np.atleast_2d(n)
    asked = n.sum(axis=0) > 0
    if len(np.unique(x[asked])) < 2:
        raise FitError(f"fit: expected answers at two levels at least, got {len(np.unique(x[asked]))}")
    order = np.argsort(x[asked])
    return x[asked][order], k[:, asked][:, order], n[:, asked][:, order]


def _placed(jnd: float, x: NDArray[np.float64]) -> tuple[float, str]:
    """The threshold and its status; of a threshold beyond the levels only the side is known."""
    if jnd > x[-1]:
        return math.inf, "above"
    return (0.0, "below") if jnd < x[0] else (jnd, "within")


@lru_cache(maxsize=16)
def _grid(
    levels: tuple[float, ...], guess: float
) -> tuple[Float[NDArray[np.float64], "g 3"], NDArray[np.float64], NDArray[np.float64]]:
    """The grid of parameters, and logarithms of their shares of right and wrong answers at the levels ``(levels,
    g)``."""
    octaves = np.log2(levels)
    mu = np.linspace(octaves[0] - _OCTAVES_BEYOND, octaves[-1] + _OCTAVES_BEYOND, _GRID[0])
    sigma = np.geomspace(*_SIGMA_LIMITS, _GRID[1])
    lapse = np.linspace(0.0, LAPSE_MAX, _GRID[2])
    rows = np.stack(np.meshgrid(mu, sigma, lapse, indexing="ij"), axis=-1).reshape(-1, 3)
    share = guess + (1.0 - guess - rows[:, 2]) * stats.norm.cdf((rows[:, 0] - octaves[:, None]) / rows[:, 1])
    share = np.clip(share, 1e-9, 1.0 - 1e-9)
    return rows, np.log(share), np.log1p(-share)


def _best(
    grid: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    correct: Int[NDArray[np.int64], "sets levels"],
    trials: Int[NDArray[np.int64], "sets levels"],
) -> Float[NDArray[np.float64], "sets 3"]:
    """The most likely parameters of the grid for each data set."""
    rows, log_right, log_wrong = grid
    counts = np.concatenate([correct, trials - correct], axis=1).astype(
        np.float64
    )  # integers have no fast matrix product
    return rows[(counts @ np.concatenate([log_right, log_wrong])).argmax(axis=1)]


def _polished(
    x: NDArray[np.float64],
    k: NDArray[np.int64],
    n: NDArray[np.int64],
    mu: float,
    sigma: float,
    lapse: float,
    guess: float,
) -> tuple[float, float, float]:
    """Parameters of the nearest maximum of the likelihood."""

    def cost(parameters: NDArray[np.float64]) -> float:
        shares = correct_share(x, parameters[0], math.exp(parameters[1]), parameters[2], guess)
        share = np.clip(shares, 1e-9, 1.0 - 1e-9)
        return -float((k * np.log(share) + (n - k) * np.log1p(-share)).sum())

    octaves = np.log2(x)
    bounds = [
        (octaves[0] - _OCTAVES_BEYOND, octaves[-1] + _OCTAVES_BEYOND),
        tuple(np.log(_SIGMA_LIMITS)),
        (0.0, LAPSE_MAX),
    ]
    start = np.array([mu, math.log(sigma), lapse])
    found = optimize.minimize(cost, start, method="L-BFGS-B", bounds=bounds)
    best = found.x if found.fun <= cost(start) else start
    return float(best[0]), float(math.exp(best[1])), float(best[2])


@dataclass(frozen=True)
class Comparison:
    """A t-test of two conditions over the same observers."""

    t: float
    p: float
    degrees: float
    mean_difference: float


def paired(first: Sequence[float], second: Sequence[float]) -> Comparison | None:
    """Student's paired t-test of shares of right answers, one entry per observer; None if there are fewer than two, or
    all differences are equal."""
    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    if a.shape != b.shape:
        raise FitError(f"paired: expected as many of both, got {a.shape} and {b.shape}")
    if len(a) < 2 or np.ptp(a - b) == 0.0:
        return None
    found = stats.ttest_rel(a, b)
    return Comparison(float(found.statistic), float(found.pvalue), len(a) - 1.0, float((a - b).mean()))
