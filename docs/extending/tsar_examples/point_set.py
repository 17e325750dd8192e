"""A point set: the additive recurrence of the generalised golden ratio, from a random start (Roberts 2018)."""

import numpy as np

_RATIO = 1.2207440846057596  # solves x^4 = x + 1


def r3(count: int, rng: np.random.Generator) -> np.ndarray:
    steps = _RATIO ** -np.arange(1.0, 4.0)
    return (rng.random(3) + np.arange(count)[:, None] * steps) % 1.0
