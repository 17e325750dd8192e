"""Kernel entry points of the filter's stages that move estimates and update them by batches (``native/surfels.h``,
``taking.h``, ``changes.h``, ``batches.h``, ``shadows.h``), as defined in ``tsar/filtering``. Threads share rows."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.compute.native_code import module_options
from renderer.stages import sizes

wp.set_module_options(module_options("batches.h", "shadows.h", given=sizes.FILTERING))


@wp.struct
class FilterPlan:
    """Sides of the plane and of the picture, its upper left part, and addresses of working memory for the plane's
    pixels."""

    side: wp.int32
    width: wp.int32
    height: wp.int32
    perspective: wp.int32
    motion: wp.uint64
    """float32: positions of the surfels and their displacements, pixels: x, y, x, y."""
    aged: wp.uint64
    """float32: variance from change at the new time."""
    depth: wp.uint64
    """float64: depth of each surfel."""
    front: wp.uint64
    """float64: depth of the surfel that each pixel takes, infinite in the frame around the pixels."""
    source: wp.uint64
    """int32: surfel that each pixel takes, -1 for none."""
    slot: wp.uint64
    """int32: index of the sums of a pixel's samples, -1 between launches."""
    pixel: wp.uint64
    """``batches::Pixel`` for every sample of a batch."""


@wp.func_native("""
    surfels::offer_own(plan, {(const double*)rows, row_count, tan_x, tan_y}, (const long long*)instance,
                       (const float*)point, (const float*)position,
                       {(const float*)plan.aged, (const float*)inverse, (const float*)roughness},
                       {(const float*)aged, (const float*)rate, seconds}, ((surfels::Band*)bands)[number]);
""")
def native_offer(
    plan: FilterPlan,
    bands: Address,
    number: wp.int32,
    rows: Address,
    row_count: wp.int32,
    tan_x: wp.float64,
    tan_y: wp.float64,
    instance: Address,
    point: Address,
    inverse: Address,
    roughness: Address,
    position: Address,
    aged: Address,
    rate: Address,
    seconds: wp.float32,
): ...


@wp.func_native("""
    surfels::choose(plan, {(const double*)rows, row_count, tan_x, tan_y}, (const long long*)instance,
                    (const float*)point, {(const float*)plan.aged, (const float*)inverse, (const float*)roughness},
                    (const surfels::Band*)bands, band_count, number);
""")
def native_choose(
    plan: FilterPlan,
    bands: Address,
    band_count: wp.int32,
    number: wp.int32,
    rows: Address,
    row_count: wp.int32,
    tan_x: wp.float64,
    tan_y: wp.float64,
    instance: Address,
    point: Address,
    inverse: Address,
    roughness: Address,
): ...


@wp.func_native("surfels::take_rows(plan, (const long long*)planes, ((const surfels::Band*)bands)[number]);")
def native_take(plan: FilterPlan, bands: Address, number: wp.int32, planes: Address): ...


@wp.func_native("batches::locate(plan, *(const batches::Batch*)batch, first, last);")
def native_locate(plan: FilterPlan, batch: Address, first: wp.int32, last: wp.int32): ...


@wp.func_native("""
    batches::Part& part = ((batches::Part*)parts)[number];
    part.pixels = batches::gather(plan, *(const batches::Batch*)batch, (int)part.first, (int)part.last);
""")
def native_gather(plan: FilterPlan, batch: Address, parts: Address, number: wp.int32): ...


@wp.func_native("batches::learn(plan, *(const batches::Batch*)batch, ((const batches::Part*)parts)[number]);")
def native_learn(plan: FilterPlan, batch: Address, parts: Address, number: wp.int32): ...


@wp.func_native("batches::take_in(plan, *(const batches::Batch*)batch, ((const batches::Part*)parts)[number]);")
def native_take_in(plan: FilterPlan, batch: Address, parts: Address, number: wp.int32): ...


@wp.func_native("shadows::drifted(*(const shadows::Batch*)batch);")
def native_drifted(batch: Address): ...


@wp.kernel
def offer(
    plan: FilterPlan,
    bands: Address,
    number: wp.int32,
    rows: Address,
    row_count: wp.int32,
    tan_x: wp.float64,
    tan_y: wp.float64,
    instance: Address,
    point: Address,
    inverse: Address,
    roughness: Address,
    position: Address,
    aged: Address,
    rate: Address,
    seconds: wp.float32,
):
    """Projects the surfels of a band, and finds the best of them for each of its pixels; ``bands`` are
    ``surfels::Band``."""
    native_offer(plan, bands, number, rows, row_count, tan_x, tan_y, instance, point, inverse, roughness, position,
                 aged, rate, seconds)  # fmt: skip


@wp.kernel
def choose(
    plan: FilterPlan,
    bands: Address,
    band_count: wp.int32,
    number: wp.int32,
    rows: Address,
    row_count: wp.int32,
    tan_x: wp.float64,
    tan_y: wp.float64,
    instance: Address,
    point: Address,
    inverse: Address,
    roughness: Address,
):
    """Finds the best of all surfels for each pixel of a band, after the projection of all bands."""
    native_choose(plan, bands, band_count, number, rows, row_count, tan_x, tan_y, instance, point, inverse,
                  roughness)  # fmt: skip


@wp.kernel
def take(plan: FilterPlan, bands: Address, number: wp.int32, planes: Address):
    """Copies the estimates and surfels that the pixels of a band take. ``planes`` are int64 addresses: those of the
    planes before (``surfels::Before``), then those that are written (``surfels::Planes``)."""
    native_take(plan, bands, number, planes)


@wp.kernel
def locate(plan: FilterPlan, batch: Address, first: wp.int32, last: wp.int32):
    """Finds the pixels of the samples of some tiles; ``batch`` is a ``batches::Batch``."""
    native_locate(plan, batch, first, last)


@wp.kernel
def gather(plan: FilterPlan, batch: Address, parts: Address, number: wp.int32):
    """Sums the samples of each pixel of some rows; ``parts`` are ``batches::Part``."""
    native_gather(plan, batch, parts, number)


@wp.kernel
def learn(plan: FilterPlan, batch: Address, parts: Address, number: wp.int32):
    """Updates roughness and change in some rows, after all parts are gathered."""
    native_learn(plan, batch, parts, number)


@wp.kernel
def take_in(plan: FilterPlan, batch: Address, parts: Address, number: wp.int32):
    """Updates rates, estimates and surfels of some rows by a batch, after change is updated in all parts."""
    native_take_in(plan, batch, parts, number)


@wp.kernel
def drifted(batch: Address):
    """Updates the speed of the shadows over each element; ``batch`` is a ``shadows::Batch``."""
    native_drifted(batch)
