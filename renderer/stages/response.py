"""The control decision in C++ (``native/response.h``), for the solver ``waterfill``, as defined in
``tsar/response``."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


@wp.struct
class ResponsePlan:
    """Parameters of the response; densities are normalised by their maxima."""

    elements: wp.int32
    spatial_high: wp.float64
    temporal_high: wp.float64
    spatial_min: wp.float64
    temporal_min: wp.float64
    gain: wp.float64
    surplus_max: wp.float64
    """Bound of the surplus, normalised as combined density is."""
    shift: wp.float64
    """Factor by which a decision moves towards space: ``2^bias``."""
    columns: wp.uint64
    """float64, working memory: ``COLUMNS`` for each element."""
    active: wp.uint64
    """int32, working memory: one for each element."""


@wp.func_native("""
    return response::respond(plan, surplus, (const double*)spatial, (const double*)temporal,
                             (const float*)error_spatial, (const float*)error_temporal, (double*)spatial_after,
                             (double*)temporal_after, (double*)plan.columns, (int*)plan.active);
""")
def decide(
    plan: ResponsePlan,
    surplus: wp.float64,
    spatial: Address,
    temporal: Address,
    error_spatial: Address,
    error_temporal: Address,
    spatial_after: Address,
    temporal_after: Address,
) -> wp.float64:
    """One control decision over the whole field. Returns the new surplus."""
    ...
