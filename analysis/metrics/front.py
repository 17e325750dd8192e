"""The Pareto front of cost and error, its knee, and the uncertainty of both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.metrics.arrays import Floats

Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]


def on_front(costs: Floats, errors: Floats) -> Flags:
    """The points on the Pareto front: no other point has at most the cost and the error, and less of one of them.

    Points that are equal in both are on the front together. A point that is not finite is not on it.

    Args:
        costs, errors: one value for each point.

    Raises:
        ValueError: the numbers of costs and errors differ.
    """
    costs, errors = np.asarray(costs, np.float64), np.asarray(errors, np.float64)
    if costs.shape != errors.shape or costs.ndim != 1:
        raise ValueError(f"front: expected as many costs as errors, got {costs.shape} and {errors.shape}")
    found = np.zeros(len(costs), bool)
    finite = np.flatnonzero(np.isfinite(costs) & np.isfinite(errors))
    order = finite[np.lexsort((errors[finite], costs[finite]))]
    least, at = np.inf, (np.nan, np.nan)
    for point in order:
        here = costs[point], errors[point]
        if here[1] < least:
            least, at = here[1], here
        found[point] = here == at
    return found


def knee(costs: Floats, errors: Floats) -> int:
    """The knee of the front.

    Both axes are logarithmic and scaled to the extent of the front, so that ``x`` and ``y`` are in [0, 1]. The knee is
    the point farthest below the line from the cheapest point to the most accurate one: ``max (1 - x - y)``.

    Source: Das 1999, "On characterizing the 'knee' of the Pareto curve based on normal-boundary intersection".

    Args:
        costs, errors: positive, one value for each point; at least one point is finite.

    Returns:
        Index of the point; that of the cheapest if no point of the front lies below the line.

    Raises:
        ValueError: there is no front, or one of its values is not positive.
    """
    front = _ordered_front(costs, errors)
    if not len(front):
        raise ValueError("knee: expected a finite point, got none")
    x, y = np.asarray(costs, np.float64)[front], np.asarray(errors, np.float64)[front]
    if x.min() <= 0.0 or y.min() <= 0.0:
        raise ValueError("knee: expected costs and errors above 0")
    below = 1.0 - _scaled(np.log(x)) - _scaled(np.log(y))
    return int(front[int(np.argmax(below))]) if below.max() > 0.0 else int(front[0])


def _ordered_front(costs: Floats, errors: Floats) -> Indices:
    """Indices of the points on the front by rising cost; of equal points only the first."""
    costs, errors = np.asarray(costs, np.float64), np.asarray(errors, np.float64)
    flat = np.flatnonzero(on_front(costs, errors))
    _, first = np.unique(np.stack((costs[flat], errors[flat])), axis=1, return_index=True)
    kept = flat[np.sort(first)]
    return kept[np.argsort(costs[kept], kind="stable")]


def _scaled(values: Floats) -> Floats:
    low, high = values.min(), values.max()
    return (values - low) / (high - low) if high > low else np.zeros_like(values)


def least_error(costs: Floats, errors: Floats, budgets: Floats) -> Floats:
    """The least error within each budget; infinite where no point is within it."""
    affordable = np.asarray(costs)[:, None] <= np.asarray(budgets)[None, :]
    return np.where(affordable, np.asarray(errors, np.float64)[:, None], np.inf).min(axis=0, initial=np.inf)


@dataclass(frozen=True)
class FrontBands:
    """Variation of a front with the runs on which it was measured.

    Attributes:
        budgets: costs at which the front is evaluated.
        low, high: quantiles of the least error at each budget; infinite where too few draws have a point within it.
        on_front: for each point, the share of the draws in which it is on the front.
        at_knee: for each point, the share of the draws in which it is the knee.
    """

    budgets: Floats
    low: Floats
    high: Floats
    on_front: Floats
    at_knee: Floats


def means(values: Floats) -> Floats:
    """Geometric means over runs. ``values`` has a row for each point and a column for each run."""
    return np.exp(np.log(values).mean(axis=1))


def bootstrap(costs: Floats, errors: Floats, budgets: Floats, draws: int = 1000, seed: int = 0) -> FrontBands:
    """Bootstrap of the front of geometric means, over runs drawn with replacement, the same for all points.

    Args:
        costs, errors: a row for each point and a column for each run (an input at a seed), positive and finite, with
            at least one of each.
        budgets: costs at which the front is evaluated.
        draws: number of bootstrap draws.
        seed: seed of the draws.

    Returns:
        Quantiles of 2.5 and 97.5 %, and shares of the draws.

    Source: Efron and Tibshirani 1993, sec. 13.3 (percentile interval).
    """
    shares = np.zeros((2, len(costs)))
    least = np.empty((draws, len(budgets)))
    for number, drawn in enumerate(_draws(costs.shape[1], draws, seed)):
        cost, error = means(costs[:, drawn]), means(errors[:, drawn])
        shares[0] += on_front(cost, error)
        shares[1, knee(cost, error)] += 1
        least[number] = least_error(cost, error, budgets)
    # the nearest draw, because interpolation with an infinite neighbour fails
    low, high = (np.quantile(least, share, axis=0, method="nearest") for share in (0.025, 0.975))
    return FrontBands(np.asarray(budgets, np.float64), low, high, shares[0] / draws, shares[1] / draws)


def interval(values: Floats, draws: int = 1000, seed: int = 0) -> tuple[float, float]:
    """Quantiles of 2.5 and 97.5 % of the geometric mean over runs drawn with replacement."""
    found = [float(means(values[None, drawn])[0]) for drawn in _draws(len(values), draws, seed)]
    low, high = np.quantile(found, (0.025, 0.975))
    return float(low), float(high)


def _draws(count: int, draws: int, seed: int) -> Iterator[Indices]:
    drawn = np.random.default_rng(seed)
    return (drawn.integers(0, count, count) for _ in range(draws))
