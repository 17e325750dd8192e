"""What settings cost and how far off they are: the front of those that nothing beats, its knee, and how sure it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]


def on_front(costs: Floats, errors: Floats) -> Flags:
    """Which points no other point beats: none costs at most as much, errs at most as much, and is less in one of them.

    Points that are equal in both are on the front together. A point that is not finite is not on it.

    Args:
        costs, errors: one value a point.

    Raises:
        ValueError: there are not as many of the one as of the other.
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
    """The point of the front from which less cost or less error is dearest.

    Both axes are logarithmic and scaled to the front's extent. The knee is the point that lies farthest below the line
    from the cheapest point of the front to the most accurate one: ``max (1 - x - y)``.

    Source: Das 1999, "On characterizing the 'knee' of the Pareto curve based on normal-boundary intersection".

    Args:
        costs, errors: positive, one value a point; at least one is finite.

    Returns:
        Number of the point; where no point of the front lies below the line, that of the cheapest.

    Raises:
        ValueError: there is no front, or a value of it is not positive.
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
    """Numbers of the points on the front by rising cost; of those that are equal, the first."""
    costs, errors = np.asarray(costs, np.float64), np.asarray(errors, np.float64)
    flat = np.flatnonzero(on_front(costs, errors))
    _, first = np.unique(np.stack((costs[flat], errors[flat])), axis=1, return_index=True)
    kept = flat[np.sort(first)]
    return kept[np.argsort(costs[kept], kind="stable")]


def _scaled(values: Floats) -> Floats:
    low, high = values.min(), values.max()
    return (values - low) / (high - low) if high > low else np.zeros_like(values)


def least_error(costs: Floats, errors: Floats, budgets: Floats) -> Floats:
    """The least error that each budget buys; infinite where it buys nothing."""
    affordable = np.asarray(costs)[:, None] <= np.asarray(budgets)[None, :]
    return np.where(affordable, np.asarray(errors, np.float64)[:, None], np.inf).min(axis=0, initial=np.inf)


@dataclass(frozen=True)
class Bands:
    """How a front varies with the runs that it was measured on.

    Attributes:
        budgets: costs at which it was looked at.
        low, high: quantiles of the least error at each; infinite where too little was affordable.
        on_front: of each point, the share of the draws in which it is on the front.
        at_knee: and in which it is the knee.
    """

    budgets: Floats
    low: Floats
    high: Floats
    on_front: Floats
    at_knee: Floats


def means(values: Floats) -> Floats:
    """Geometric means over runs. ``values`` has a row a point and a column a run."""
    return np.exp(np.log(values).mean(axis=1))


def bootstrap(costs: Floats, errors: Floats, budgets: Floats, draws: int = 1000, seed: int = 0) -> Bands:
    """Bands of the front of geometric means, from runs drawn with replacement, the same for all points.

    Args:
        costs, errors: a row a point and a column a run (an input at a seed), positive and finite, at least one of each.
        budgets: costs at which the front is looked at.
        draws: how often.
        seed: of the draws.

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
    # the nearest of the draws, as an infinite neighbour cannot be interpolated
    low, high = (np.quantile(least, share, axis=0, method="nearest") for share in (0.025, 0.975))
    return Bands(np.asarray(budgets, np.float64), low, high, shares[0] / draws, shares[1] / draws)


def interval(values: Floats, draws: int = 1000, seed: int = 0) -> tuple[float, float]:
    """Quantiles of 2.5 and 97.5 % of the geometric mean of runs that are drawn with replacement."""
    found = [float(means(values[None, drawn])[0]) for drawn in _draws(len(values), draws, seed)]
    low, high = np.quantile(found, (0.025, 0.975))
    return float(low), float(high)


def _draws(count: int, draws: int, seed: int) -> Iterator[Indices]:
    drawn = np.random.default_rng(seed)
    return (drawn.integers(0, count, count) for _ in range(draws))
