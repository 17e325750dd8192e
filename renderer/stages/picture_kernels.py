"""Kernel entry points of the filter's stages that show a picture and choose tiles (``native/pyramid.h``,
``noise.h``, ``gains.h``), as defined in ``tsar/filtering``. Threads share rows."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.compute.native_code import module_options
from renderer.stages import sizes

wp.set_module_options(module_options("gains.h", "noise.h", "pyramid.h", given=sizes.FILTERING))


@wp.func_native("""
    gains::of_tiles({(const float*)variance, (const float*)roughness, (const float*)rate, (const float*)step,
                     (const long long*)instance},
                    {cycle_s, reach_px, life_min_s, life_max_s}, side, coarsest, levels, spacing, first, last,
                    (double*)gain);
""")
def native_gain(
    side: wp.int32,
    coarsest: wp.int32,
    levels: wp.int32,
    spacing: wp.float32,
    gain: Address,
    first: wp.int32,
    last: wp.int32,
    variance: Address,
    roughness: Address,
    rate: Address,
    step: Address,
    instance: Address,
    cycle_s: wp.float32,
    reach_px: wp.float32,
    life_min_s: wp.float32,
    life_max_s: wp.float32,
): ...


@wp.func_native("""
    gains::best((const double*)gain, levels, coarsest, limit, (double*)most, (unsigned char*)taken, (int*)found);
""")
def native_best(
    gain: Address,
    levels: wp.int32,
    coarsest: wp.int32,
    most: Address,
    taken: Address,
    found: Address,
    limit: wp.int32,
): ...


@wp.func_native("pyramid::shrink(*(const pyramid::Picture*)picture, side, seconds, first, last, (float*)spare);")
def native_shrink(
    picture: Address, side: wp.int32, first: wp.int32, last: wp.int32, spare: Address, seconds: wp.float32
): ...


@wp.func_native("pyramid::smooth((float*)levels, side, width, height, (float*)spare);")
def native_smooth(levels: Address, side: wp.int32, width: wp.int32, height: wp.int32, spare: Address): ...


@wp.func_native("pyramid::show(*(const pyramid::Picture*)picture, side, first, last, (float*)spare);")
def native_show(picture: Address, side: wp.int32, first: wp.int32, last: wp.int32, spare: Address): ...


@wp.func_native("noise::detailed(*(const noise::Planes*)planes, first, last, (float*)spare);")
def native_detailed(planes: Address, first: wp.int32, last: wp.int32, spare: Address): ...


@wp.kernel
def gain(
    side: wp.int32,
    coarsest: wp.int32,
    levels: wp.int32,
    spacing: wp.float32,
    gain: Address,
    first: wp.int32,
    last: wp.int32,
    variance: Address,
    roughness: Address,
    rate: Address,
    step: Address,
    instance: Address,
    cycle_s: wp.float32,
    reach_px: wp.float32,
    life_min_s: wp.float32,
    life_max_s: wp.float32,
):
    """Computes the gains of the tiles of all levels within some rows of the coarsest."""
    native_gain(side, coarsest, levels, spacing, gain, first, last, variance, roughness, rate, step, instance,
                cycle_s, reach_px, life_min_s, life_max_s)  # fmt: skip


@wp.kernel
def best(
    gain: Address,
    levels: wp.int32,
    coarsest: wp.int32,
    most: Address,
    taken: Address,
    found: Address,
    limit: wp.int32,
):
    """Finds the best tiles of all levels; ``found`` receives their number."""
    native_best(gain, levels, coarsest, most, taken, found, limit)


@wp.kernel
def shrink(picture: Address, side: wp.int32, first: wp.int32, last: wp.int32, spare: Address, seconds: wp.float32):
    """Computes some rows of the second finest level from the estimates; ``picture`` is a ``pyramid::Picture``."""
    native_shrink(picture, side, first, last, spare, seconds)


@wp.kernel
def smooth(levels: Address, side: wp.int32, width: wp.int32, height: wp.int32, spare: Address):
    """Computes the coarser levels from the second finest and smooths them, in place; ``width`` and ``height`` are those
    of the picture at the second finest level."""
    native_smooth(levels, side, width, height, spare)


@wp.kernel
def show(picture: Address, side: wp.int32, first: wp.int32, last: wp.int32, spare: Address):
    """Computes the picture from some rows of the second finest level."""
    native_show(picture, side, first, last, spare)


@wp.kernel
def detailed(planes: Address, first: wp.int32, last: wp.int32, spare: Address):
    """Computes some rows of the roughness without noise; ``planes`` is a ``noise::Planes``."""
    native_detailed(planes, first, last, spare)
