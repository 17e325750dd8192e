"""The first stage after tracing: it estimates the errors of a batch and stores its colours and wavelet states in the
cache."""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from tsar.cache import FrameletCache
from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.error import estimate
from tsar.types import Errors, FrameletBatch


@dataclass(frozen=True)
class Observation:
    """Errors on the field, and the number of non-finite samples."""

    errors: Errors
    nonfinite: int


def observe(
    batch: FrameletBatch,
    color: Float[Tensor, "n samples 3"],
    cache: FrameletCache,
    config: TsarConfig,
    timer: StageTimer,
) -> Observation:
    """Estimates the errors of a batch (:func:`tsar.error.estimate`) and stores the batch in the cache, in place.

    Args:
        timer: receives the durations of ``error`` and ``cache``.
    """
    with timer("error"):
        found = estimate(batch, color, cache, config)
    with timer("cache"):
        cache.insert(batch, found.color, found.coefficients)
    return Observation(found.errors, found.nonfinite)
