"""The best rival: at each moment the best of all rivals that ran, and how a policy stands beside it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from analysis.metrics.quality import Floats

BEST = "best-rival"
"""Its name in tables."""


@dataclass(frozen=True)
class Standing:
    """A policy beside another one, by one metric.

    Attributes:
        times: moments at which both were measured.
        share: of these, at how many the policy is at least as good; NaN where there are none.
        ratio: its median over the other's; NaN where there are none, infinite where only the other's is 0.
    """

    times: int
    share: float
    ratio: float


def best_of(traces: Iterable[Floats], sign: int = -1) -> Floats:
    """The best value at each moment, NaN where no trace has one.

    Args:
        traces: of the same moments, NaN where not measured.
        sign: 1 where more is better, -1 where less is.

    Raises:
        ValueError: there are no traces.
    """
    found = list(traces)
    if not found:
        raise ValueError("best_of: expected at least one trace, got none")
    return (np.fmax if sign > 0 else np.fmin).reduce(np.stack(found))


def best_shares(traces: Mapping[str, Floats], sign: int = -1) -> dict[str, float]:
    """Share of the moments at which each trace is the best one; where several are, each counts."""
    best = best_of(traces.values(), sign)
    known = ~np.isnan(best)
    count = max(int(known.sum()), 1)
    return {name: float((trace[known] == best[known]).sum() / count) for name, trace in traces.items()}


def standing(own: Floats, other: Floats, sign: int = -1) -> Standing:
    """How a policy stands beside another one.

    Args:
        own, other: values of the same moments, NaN where not measured.
        sign: 1 where more is better, -1 where less is.
    """
    own, other = np.asarray(own, np.float64), np.asarray(other, np.float64)
    known = ~np.isnan(own) & ~np.isnan(other)
    own, other = own[known], other[known]
    if not len(own):
        return Standing(0, np.nan, np.nan)
    medians = float(np.median(own)), float(np.median(other))
    ratio = medians[0] / medians[1] if medians[1] else 1.0 if medians[0] == medians[1] else np.inf
    return Standing(len(own), float((sign * own >= sign * other).mean()), ratio)
