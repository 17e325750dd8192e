"""The same data fitted by psignifit, an optional extra, to compare with our own fits.

psignifit is under the GPL: nothing else here imports it, and everything works without it.

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
    """What psignifit makes of the data.

    Attributes:
        jnd: samples per pixel at the threshold.
        interval: credible, 95 %, of the middle of the function, which is the threshold where there are no lapses.
        width: of the function between 5 % and 95 % of its rise, octaves.
        overdispersion: ``eta``, 0 for answers as binomial as a coin's.
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

    # it wants functions that rise
    data = np.stack([-np.log2(np.asarray(levels, np.float64)), correct, trials], axis=1)
    data = data[data[:, 2] > 0][::-1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = psignifit.psignifit(data, sigmoid="norm", experiment_type="2AFC", verbose=False)
            at = float(np.squeeze(found.threshold(np.array(THRESHOLD), return_ci=False)))
        except Exception as error:  # its own has no public name
            raise InputError(f"psignifit: expected a threshold, got {error}") from None
    intervals: Any = found.confidence_intervals
    low, high = intervals["threshold"]["0.95"]
    estimate = found.parameter_estimate
    return PeerFit(2.0**-at, (2.0**-high, 2.0**-low), float(estimate["width"]), float(estimate["eta"]))
