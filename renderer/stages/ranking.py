"""The greatest of many values without sorting (``native/ranking.h``); selection, cache and tiling use it.

Each ranks by float64 values and takes the first ``k``. The values are mapped to unsigned keys of the same order. The
key of the ``k``-th is found bit by bit from the top by counting the keys above a bound; a pass takes a few vector
instructions for several hundred values. All keys above the bound are taken, and of those equal to it as many as are
missing, in a fixed order.

Addresses are passed as numbers, which makes launches cheaper than descriptions of arrays.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


@wp.func_native("ranking::rank_keys((const double*)value, count, (ranking::Key*)key);")
def rank_keys(value: Address, count: wp.int32, key: Address):
    """Unsigned keys in the order of the float64 values, which must not be NaN."""
    ...


@wp.func_native("return ranking::kth_greatest((const ranking::Key*)key, count, wanted);")
def kth_greatest(key: Address, count: wp.int32, wanted: wp.int32) -> wp.uint64:
    """A bound such that the ``wanted`` greatest keys are at least it, and other keys at most equal to it, so that all
    keys above it are taken. 0 if there are fewer keys.
    """
    ...


@wp.func_native("return ranking::count_above((const ranking::Key*)key, count, (ranking::Key)threshold);")
def count_above(key: Address, count: wp.int32, threshold: wp.uint64) -> wp.int32:
    """Number of keys above the threshold."""
    ...
