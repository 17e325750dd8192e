"""The greatest of many values without sorting (``native/ranking.h``); selection, cache and tiling use it.

Each ranks by a float64 and takes the ``k`` first. A float64 becomes an unsigned key of the same order, and the key of
the ``k``-th is found bit by bit from the top: passes that count, each a few vector instructions for several hundred
values, until as many lie above as are wanted. All above it are taken, and of those equal to it as
many as are missing, in a stated order.

Addresses are passed as numbers: a launch then costs less, for no array has to be described.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


@wp.func_native("ranking::rank_keys((const double*)value, count, (ranking::Key*)key);")
def rank_keys(value: Address, count: wp.int32, key: Address):
    """Unsigned keys that order as the float64 values do; no NaN among them."""
    ...


@wp.func_native("return ranking::kth_greatest((const ranking::Key*)key, count, wanted);")
def kth_greatest(key: Address, count: wp.int32, wanted: wp.int32) -> wp.uint64:
    """A bound that the ``wanted`` greatest keys reach, and of the others only those equal to the least of them: keys
    above the bound are all taken. 0 where there are not so many keys.
    """
    ...


@wp.func_native("return ranking::count_above((const ranking::Key*)key, count, (ranking::Key)threshold);")
def count_above(key: Address, count: wp.int32, threshold: wp.uint64) -> wp.int32:
    """How many keys exceed the threshold."""
    ...
