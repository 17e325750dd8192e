"""Reconstruction, first half, in C++ (``native/ages.h``): ages of the newest samples, and framelets that may be
visible.

*Cells* are tiles of the finest level, in raster order. Definitions are in ``tsar/reconstruction.py``.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


@wp.struct
class DisplayPlan:
    """Parameters of the reconstruction, and the addresses of its tables and working memory."""

    resolution: wp.int32
    level_low: wp.int32
    level_high: wp.int32
    side: wp.int32
    """Samples along a framelet's side."""
    half: wp.int32
    """Half width of the smoothing of ages, pixels."""
    reach: wp.int32
    """Reach of smoothing and the widest margin to either side, cells."""
    band: wp.int32
    """Number of rows of a band, which is finished at a time."""
    order: wp.uint64
    """int32, raster to Morton order of a framelet's samples."""
    left: wp.uint64
    right: wp.uint64
    """int32: the two samples around each pixel of a tile along an axis, including its margin; one level after the other
    from the coarsest. The next three arrays have the same order."""
    share_left: wp.uint64
    share_right: wp.uint64
    """float32: weights of the two samples, whose sum is one."""
    weight: wp.uint64
    """float32: total weight of each pixel, below one in the margin and at the border, where the neighbouring tile adds
    the rest."""
    first: wp.uint64
    """int32: first index of each level in these arrays."""
    margin: wp.uint64
    """int32: width of the margin of each level's tiles, pixels."""
    node_time: wp.uint64
    """float64: newest sample time of every node of the quadtree."""
    node_level: wp.uint64
    """int32: level of that sample."""
    cell_age: wp.uint64
    """float32: age of each cell, cycles."""
    cell_least: wp.uint64
    """float32: least age within reach of each cell, and working memory of the same size."""
    row_sum: wp.uint64
    """float64: for each row of cells, the sums of ages over a box of pixels around each column."""
    row_integral: wp.uint64
    """float64, working memory: one element for each pixel of a row within reach of the smoothing, and one more."""
    slot_age: wp.uint64
    """float32: age of each slot, cycles."""
    candidate: wp.uint64
    """int32: slots that may be visible."""
    seen: wp.uint64
    """int32: whether each slot was visible."""


@wp.func_native(
    """
    return display::map_newest(plan, slots, (const long long*)level, (const long long*)index, (const double*)time_s,
                               (double*)newest_s, (long long*)newest_level);
    """
)
def map_newest(
    plan: DisplayPlan,
    slots: wp.int32,
    level: Address,
    index: Address,
    time_s: Address,
    newest_s: Address,
    newest_level: Address,
) -> wp.float64:
    """Newest sample time and its level over every cell. Returns the newest of all times, 0 if there is none."""
    ...


@wp.func_native("display::smooth_rows(plan, reference, cycle_s, (const double*)newest_s);")
def smooth_rows(plan: DisplayPlan, reference: wp.float64, cycle_s: wp.float64, newest_s: Address):
    """Ages of the cells in cycles, and their sums along rows."""
    ...


@wp.func_native(
    """
    return display::list_candidates(plan, reference, cycle_s, slots, (const long long*)level, (const long long*)index,
                                    (const double*)time_s);
    """
)
def list_candidates(
    plan: DisplayPlan,
    reference: wp.float64,
    cycle_s: wp.float64,
    slots: wp.int32,
    level: Address,
    index: Address,
    time_s: Address,
) -> wp.int32:
    """Lists the slots that are not older than all cells within reach of smoothing and their margins; the others cannot
    be visible."""
    ...
