"""Fits of the same data by psignifit, an optional extra, for comparison with our own fits.

psignifit is under the GPL: no other module imports it, and everything works without it.

Source: Schütt, Harmeling, Macke and Wichmann 2016, "Painfree and accurate Bayesian estimation of psychometric functions
for (potentially) overdispersed data".
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.command.cli import InputError
from analysis.command.extras import require_extra
from analysis.perception.psychometrics import THRESHOLD


@dataclass(frozen=True)
class PeerFit:
    """The fit of psignifit.

    Attributes:
        jnd: samples per pixel at the threshold.
        interval: 95 % credible interval of the middle of the function, which is the threshold if there are no lapses.
        width: width of the function between 5 % and 95 % of its rise, octaves.
        overdispersion: ``eta``, 0 for binomial answers.
    """

    jnd: float
    interval: tuple[float, float]
    width: float
    overdispersion: float


def peer_fit(levels: Sequence[float], correct: Sequence[int], trials: Sequence[int]) -> PeerFit:
    """Fits a cumulative Gaussian over the logarithm of the samples, two alternatives, with psignifit's own priors.

    Raises:
        InputError: psignifit is not installed, or finds no threshold.
    """
    require_extra("psignifit")
    import psignifit

    # psignifit expects rising functions
    data = np.stack([-np.log2(np.asarray(levels, np.float64)), correct, trials], axis=1)
    data = data[data[:, 2] > 0][::-1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = psignifit.psignifit(data, sigmoid="norm", experiment_type="2AFC", verbose=False)
            at = float(np.squeeze(found.threshold(np.array(THRESHOLD), return_ci=False)))
        except Exception as error:  # psignifit's error class has no public name
            raise InputError(f"psignifit: expected a threshold, got {error}") from None
    intervals: Any = found.confidence_intervals
    low, high = intervals["threshold"]["0.95"]
    estimate = found.parameter_estimate
    return PeerFit(2.0**-at, (2.0**-high, 2.0**-low), float(estimate["width"]), float(estimate["eta"]))
