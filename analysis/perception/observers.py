"""Simulated observers: the visibility of a difference to them, and their answers.

The task is a dual pair: of two pairs shown side by side one is identical and one differs, and the observer says which
differs. An observer that compares the differences within the pairs is right with probability
``Φ(d'/2)² + Φ(-d'/2)²``, where ``d'`` is the difference in units of the noise of a single stimulus.

Source: Macmillan and Creelman 2005, "Detection Theory", ch. 7 and 9 (differencing rule); Mantiuk et al. 2024 (JOD).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy.typing import NDArray
from scipy import stats

TASK = "dual pair, differencing observer"
JOD_SIGMA = 1.048
"""Noise of a single stimulus in JOD: one JOD is preferred in 75 % of pairs, so ``1 / (√2 Φ⁻¹(0.75))``."""

COLUMNS = (
    "observer", "observer_kind", "task", "session", "trial", "scene", "point_set", "time_filter", "samples",
    "repetition", "differing_side", "answer", "correct", "response_s",
)  # fmt: skip
"""Columns of a table of trials, both of people and of simulated observers."""


@dataclass(frozen=True)
class Observer:
    """A simulated observer.

    Attributes:
        name: name in the table.
        sensitivity: factor of the difference in JOD.
        lapse: share of answers that are guesses.
    """

    name: str
    sensitivity: float
    lapse: float


def dual_pair_share(d_prime: Float[NDArray[np.float64], "*n"]) -> Float[NDArray[np.float64], "*n"]:
    """Probability ``Φ(d'/2)² + Φ(-d'/2)²`` that a differencing observer names the pair that differs."""
    half = np.asarray(d_prime, np.float64) / 2.0
    return stats.norm.cdf(half) ** 2 + stats.norm.cdf(-half) ** 2


def correct_probability(
    jod: Float[NDArray[np.float64], "*n"], observer: Observer, sigma: float = JOD_SIGMA
) -> Float[NDArray[np.float64], "*n"]:
    """Probability of a right answer to stimuli that differ by ``jod``; negative differences count as 0."""
    seen = dual_pair_share(np.maximum(jod, 0.0) * observer.sensitivity / sigma)
    return (1.0 - observer.lapse) * seen + observer.lapse * 0.5


def drawn_observers(count: int, seed: int, spread: float, lapse_mean: float) -> tuple[Observer, ...]:
    """Observers whose sensitivities are log-normal about 1 and whose lapses are exponential.

    Args:
        count: number of observers.
        seed: seed of the draw.
        spread: standard deviation of the logarithm of the sensitivity.
        lapse_mean: mean of the exponential distribution of the lapse rate; rates are at most 0.2.
    """
    rng = np.random.default_rng([seed, 0x0B5])
    sensitivity = np.exp(spread * rng.standard_normal(count))
    lapse = np.minimum(rng.exponential(lapse_mean, count), 0.2) if lapse_mean > 0.0 else np.zeros(count)
    return tuple(
        Observer(f"s{i:02d}", float(s), float(p)) for i, (s, p) in enumerate(zip(sensitivity, lapse, strict=True))
    )


def simulated_trials(
    stimuli: pd.DataFrame, observers: Sequence[Observer], repetitions: int, seed: int, sigma: float = JOD_SIGMA
) -> pd.DataFrame:
    """Trials in which every observer answers every stimulus ``repetitions`` times, in a random order.

    Args:
        stimuli: rows of ``scene``, ``point_set``, ``time_filter``, ``samples`` and ``jod``, the difference from the
            reference.
        observers: the observers.
        repetitions: number of answers to every stimulus.
        seed: seed of orders, sides and answers. Those of one observer do not depend on the others.
        sigma: noise of a single stimulus, JOD.

    Returns:
        Trials with the columns :data:`COLUMNS`; ``response_s`` is NaN.
    """
    tables = [
        _trials_of(stimuli, observer, number, repetitions, seed, sigma) for number, observer in enumerate(observers)
    ]
    return pd.concat(tables, ignore_index=True)


def _trials_of(
    stimuli: pd.DataFrame, observer: Observer, number: int, repetitions: int, seed: int, sigma: float
) -> pd.DataFrame:
    rng = np.random.default_rng([seed, number, 0x7A1])
    rows = stimuli.loc[stimuli.index.repeat(repetitions)].reset_index(drop=True)
    rows["repetition"] = np.tile(np.arange(repetitions), len(stimuli))
    rows = rows.iloc[rng.permutation(len(rows))].reset_index(drop=True)
    right = rng.random(len(rows)) < correct_probability(rows["jod"].to_numpy(), observer, sigma)
    side = rng.choice(["left", "right"], len(rows))
    other = np.where(side == "left", "right", "left")
    fixed: dict[str, Any] = {"observer": observer.name, "observer_kind": "simulated", "task": TASK, "session": 0}
    rows = rows.assign(
        **fixed,
        trial=np.arange(len(rows)),
        differing_side=side,
        answer=np.where(right, side, other),
        correct=right,
        response_s=np.nan,
    )
    return rows[list(COLUMNS)]
