"""Reconstruction, first half, in C++ (``native/ages.h``): ages of the newest samples, and framelets that may be seen.

*Cells* are tiles of the finest level, raster order. Definitions in ``tsar/reconstruction.py``.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


@wp.struct
class DisplayPlan:
    """What of the configuration reconstruction depends on, and where its working memory lies."""

    resolution: wp.int32
    level_low: wp.int32
    level_high: wp.int32
    side: wp.int32
    """Samples along a framelet's side."""
    half: wp.int32
    """Pixels that the smoothing of ages reaches to either side."""
    reach: wp.int32
    """Cells that smoothing and the widest margin reach to either side."""
    band: wp.int32
    """Rows of the image that are finished at a time."""
    order: wp.uint64
    """int32, raster to Morton order of a framelet's samples."""
    left: wp.uint64
    right: wp.uint64
    """int32, of each pixel of a tile along an axis, margin included: the two samples that it lies between; level after
    level from the coarsest, as are the next three."""
    share_left: wp.uint64
    share_right: wp.uint64
    """float32, their shares, which sum to one."""
    weight: wp.uint64
    """float32, below one in the margin and at the border, where the neighbouring tile adds the rest."""
    first: wp.uint64
    """int32, where a level's pixels begin in these."""
    margin: wp.uint64
    """int32, pixels of margin of a level's tiles."""
    node_time: wp.uint64
    """float64, of every node of the quadtree."""
    node_level: wp.uint64
    """int32, the same."""
    cell_age: wp.uint64
    """float32, per cell."""
    cell_least: wp.uint64
    """float32, per cell, and as much again to work in."""
    row_sum: wp.uint64
    """float64, per row of cells the sums of ages over a box of pixels around each column."""
    row_integral: wp.uint64
    """float64, working memory: one for each pixel of a row that smoothing reaches, and one more."""
    slot_age: wp.uint64
    """float32, per slot."""
    candidate: wp.uint64
    """int32, slots that may be seen."""
    seen: wp.uint64
    """int32, per slot."""


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
    """Newest time and its level over every cell. Returns the newest of all, 0 where there is none."""
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
    """Slots not older than everything that smoothing and their margins reach; the others cannot be seen."""
    ...
