"""The bookkeeping of the cache in C++ (``native/claims.h``): slots that a batch takes, and the states that they held.

Definition: ``tsar/cache.py``.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.stages.ranking import count_above, kth_greatest, rank_keys


@wp.struct
class CacheView:
    """Addresses of a framelet cache's tensors."""

    slots: wp.int32
    samples: wp.int32
    state: wp.int32
    level: wp.uint64
    index: wp.uint64
    time_s: wp.uint64
    dead: wp.uint64
    color: wp.uint64
    coefficients: wp.uint64
    slot_of_node: wp.uint64


@wp.struct
class ClaimMemory:
    """Addresses of a batch's slots and of working memory."""

    slot: wp.uint64
    """int64: slot of each framelet."""
    past: wp.uint64
    """Address of the wavelet state of each tile's last framelet, 0 where there is none."""
    spare: wp.uint64
    """Room for the wavelet states of a batch; states in slots that are overwritten are saved there."""
    marks: wp.uint64
    """uint8: one per slot, all 0 between calls."""


@wp.func_native("return claims::rank_slots(cache, wanted, (double*)age);")
def rank_slots(cache: CacheView, wanted: wp.int32, age: Address) -> wp.int32:
    """Ages by which slots are chosen for replacement: those of the dead slots if they suffice, else of the live ones.

    Returns:
        The number of dead slots that are replaced in addition to those chosen by age: all, or none.
    """
    ...


@wp.func_native(
    "claims::list_victims(cache, (const ranking::Key*)key, threshold, ties, with_dead != 0, (long long*)slot);"
)
def list_victims(
    cache: CacheView, key: Address, threshold: wp.uint64, ties: wp.int32, with_dead: wp.int32, slot: Address
):
    """Lists the slots to overwrite, in ascending order."""
    ...


@wp.func_native(
    "claims::sign_over(cache, memory, count, (const long long*)level, (const long long*)index, (const double*)time_s);"
)
def sign_over(
    cache: CacheView,
    memory: ClaimMemory,
    count: wp.int32,
    level: Address,
    index: Address,
    time_s: Address,
):
    """Assigns slots to the tiles of a batch, and finds the wavelet state of each tile's last framelet."""
    ...


@wp.func
def choose_victims(cache: CacheView, age: Address, key: Address, count: wp.int32, slot: Address):
    """The least valuable slots: dead ones from the oldest on, then the oldest of the others."""
    all_dead = rank_slots(cache, count, age)
    rank_keys(age, cache.slots, key)
    by_age = count - all_dead
    threshold = kth_greatest(key, cache.slots, by_age)
    ties = by_age - count_above(key, cache.slots, threshold)
    list_victims(cache, key, threshold, ties, all_dead, slot)
