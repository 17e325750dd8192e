"""The best rival, which is at each moment the best of all rivals that ran, and the comparison of a policy with it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from analysis.metrics.arrays import Floats

BEST = "best-rival"
"""Name of the best rival in tables."""


@dataclass(frozen=True)
class Standing:
    """A policy beside another one, by one metric.

    Attributes:
        times: number of moments at which both were measured.
        share: share of these moments at which the policy is at least as good; NaN if there are none.
        ratio: median of the policy over that of the other; NaN if there are none, infinite if only the other's is 0.
    """

    times: int
    share: float
    ratio: float


def best_of(traces: Iterable[Floats], sign: int = -1) -> Floats:
    """The best value at each moment; NaN where no trace has one.

    Args:
        traces: values at the same moments, NaN where not measured.
        sign: 1 if higher is better, -1 if lower is better.

    Raises:
        ValueError: there are no traces.
    """
    found = list(traces)
    if not found:
        raise ValueError("best_of: expected at least one trace, got none")
    return (np.fmax if sign > 0 else np.fmin).reduce(np.stack(found))


def best_shares(traces: Mapping[str, Floats], sign: int = -1) -> dict[str, float]:
    """Share of the moments at which each trace is the best one; equally good traces all count."""
    best = best_of(traces.values(), sign)
    known = ~np.isnan(best)
    count = max(int(known.sum()), 1)
    return {name: float((trace[known] == best[known]).sum() / count) for name, trace in traces.items()}


def standing(own: Floats, other: Floats, sign: int = -1) -> Standing:
    """Compares a policy with another one.

    Args:
        own, other: values at the same moments, NaN where not measured.
        sign: 1 if higher is better, -1 if lower is better.
    """
    own, other = np.asarray(own, np.float64), np.asarray(other, np.float64)
    known = ~np.isnan(own) & ~np.isnan(other)
    own, other = own[known], other[known]
    if not len(own):
        return Standing(0, np.nan, np.nan)
    medians = float(np.median(own)), float(np.median(other))
    ratio = medians[0] / medians[1] if medians[1] else 1.0 if medians[0] == medians[1] else np.inf
    return Standing(len(own), float((sign * own >= sign * other).mean()), ratio)
