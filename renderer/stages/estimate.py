"""The estimate of signed errors from colours in C++ (``native/framelets.h``), as defined in ``tsar/error.py``,
``tsar/estimators.py`` and ``tsar/haar.py``."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.stages.cache import CacheView, ClaimMemory


@wp.struct
class ErrorPlan:
    """Parameters of the estimate."""

    samples: wp.int32
    """Number of samples per framelet, at most 1024."""
    octaves: wp.int32
    state: wp.int32
    """Number of coefficients kept per framelet."""
    field_level: wp.int32
    linf: wp.int32
    """Whether the norm is the greatest power instead of the total."""
    difference: wp.int32
    """Whether the error is a difference of logarithms instead of a contrast."""
    greatest: wp.int32
    """Whether the octave of the greatest error counts, instead of the sums over octaves."""
    per_tile: wp.int32
    """Whether a tile has one error, instead of one for each element."""
    templates: wp.uint64
    """float32: tolerated powers of the template, by space and time, number 4^k of parts of a tile, and octave."""
    radiance_max: wp.float32


@wp.func_native(
    "framelets::start(plan, count, (unsigned char*)pending, (float*)errors_spatial, (float*)errors_temporal);"
)
def start_observing(
    plan: ErrorPlan, count: wp.int32, pending: Address, errors_spatial: Address, errors_temporal: Address
):
    """Clears the fields of errors, and marks all framelets as pending."""
    ...


@wp.func_native("""
    framelets::observe_rows(plan, cache, count, (const long long*)level, (const long long*)index, (const float*)color,
                            (const long long*)memory.slot, (const float* const*)memory.past, (unsigned char*)pending,
                            (framelets::Progress*)progress, (float*)errors_spatial, (float*)errors_temporal);
""")
def observe_framelets(
    plan: ErrorPlan,
    cache: CacheView,
    memory: ClaimMemory,
    pending: Address,
    progress: Address,
    count: wp.int32,
    level: Address,
    index: Address,
    color: Address,
    errors_spatial: Address,
    errors_temporal: Address,
):
    """Computes the errors of pending framelets, and stores colours and wavelet states in their slots; threads share the
    framelets.

    Args:
        pending: uint8 flags; those of framelets with a non-finite sample remain set.
        progress: int32: number of framelets taken, and number that remain pending.
    """
    ...
