"""From colours to signed errors in C++ (``native/framelets.h``); defined in ``tsar/error.py``,
``tsar/estimators.py`` and ``tsar/haar.py``."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.stages.cache import CacheView, ClaimMemory


@wp.struct
class ErrorPlan:
    """What of the configuration the estimate depends on."""

    samples: wp.int32
    """Per framelet, at most 1024."""
    octaves: wp.int32
    state: wp.int32
    """Coefficients kept per framelet."""
    field_level: wp.int32
    linf: wp.int32
    """Whether the norm is the greatest power instead of the total."""
    difference: wp.int32
    """Whether the error is a difference of logarithms instead of a contrast."""
    greatest: wp.int32
    """Whether the octave of the greatest error decides, instead of the sums over octaves."""
    per_tile: wp.int32
    """Whether a tile has one error, instead of one for each element."""
    templates: wp.uint64
    """Powers that the template tolerates: float32, for space and time, by 4^k parts of a tile, by octave."""
    radiance_max: wp.float32


@wp.func_native(
    "framelets::start(plan, count, (unsigned char*)pending, (float*)errors_spatial, (float*)errors_temporal);"
)
def start_observing(
    plan: ErrorPlan, count: wp.int32, pending: Address, errors_spatial: Address, errors_temporal: Address
):
    """Fields of zeros, and all framelets pending."""
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
    """Errors of framelets that are pending, and colours and wavelet states into their slots; threads share them.

    Args:
        pending: uint8 flags; what remains set holds a sample that is not finite.
        progress: int32, how many are taken, and how many remain.
    """
    ...
