"""Reconstruction, second half, in C++ (``native/bands.h``): from the threshold of ages to finished pixels.

Each band of rows is small enough for the second-level cache. A band's working memory holds five planes of its pixels:
threshold, sums of weight, red, green, blue. A framelet is first expanded along rows to pixels (*rows*, one per row of
samples); then every row of pixels is a blend of two of these (``native/display.h``). Definitions are in
``tsar/reconstruction.py``.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.stages.ages import DisplayPlan


@wp.func_native("display::begin_band(plan, top, bottom, (float*)planes, (double*)box, (float*)ages);")
def begin_band(plan: DisplayPlan, top: wp.int32, bottom: wp.int32, planes: Address, box: Address, ages: Address):
    """Sets the thresholds of the rows from ``top`` to before ``bottom``, and clears the sums."""
    ...


@wp.func_native("return display::corner(plan, level, index, axis);")
def corner(plan: DisplayPlan, level: wp.int32, index: wp.int64, axis: wp.int32) -> wp.int32:
    """First pixel of a tile along an axis; 0 is x."""
    ...


@wp.func_native("return display::passes(plan, level, x, y, age, top, bottom, (const float*)planes);")
def passes(
    plan: DisplayPlan,
    level: wp.int32,
    x: wp.int32,
    y: wp.int32,
    age: wp.float32,
    top: wp.int32,
    bottom: wp.int32,
    planes: Address,
) -> wp.int32:
    """Whether a framelet is not older than the threshold at some pixel of the band that it reaches."""
    ...


@wp.func_native(
    "display::expand_rows(plan, slot, level, y, top, bottom, (const float*)color, (float*)samples, (float*)rows);"
)
def expand_rows(
    plan: DisplayPlan,
    slot: wp.int32,
    level: wp.int32,
    y: wp.int32,
    top: wp.int32,
    bottom: wp.int32,
    color: Address,
    samples: Address,
    rows: Address,
):
    """Interpolates the rows of a framelet's samples that the band needs to pixels; per row red, green, blue."""
    ...


@wp.func_native("display::blend_rows(plan, level, x, y, age, top, bottom, (const float*)rows, (float*)planes);")
def blend_rows(
    plan: DisplayPlan,
    level: wp.int32,
    x: wp.int32,
    y: wp.int32,
    age: wp.float32,
    top: wp.int32,
    bottom: wp.int32,
    rows: Address,
    planes: Address,
):
    """Adds a framelet to the band's sums, weighted by the cycles by which it is newer than the threshold, plus half a
    cycle."""
    ...


@wp.func_native("return display::finish_band(plan, top, bottom, (const float*)planes, (float*)image);")
def finish_band(plan: DisplayPlan, top: wp.int32, bottom: wp.int32, planes: Address, image: Address) -> wp.int32:
    """Converts sums to colours. Returns whether any pixel has none."""
    ...


@wp.func_native("return display::bury(plan, slots, (const long long*)level, (unsigned char*)dead);")
def bury(plan: DisplayPlan, slots: wp.int32, level: Address, dead: Address) -> wp.float64:
    """Flags the framelets that were visible nowhere. Returns the total area of the others, in units of the image."""
    ...
