"""Tiling and the sums of a cycle's record in C++ (``native/tiling.h``, ``native/account.h``).

Nodes of the quadtree are stored one level after the other, coarse first: level ``L`` begins at ``(4^L - 1) / 3``.
Definitions are in ``tsar/tiling.py`` and ``tsar/accounting.py``.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


@wp.func_native("return (int)quadtree::first_node(level);")
def first_node(level: wp.int32) -> wp.int32:
    """Number of the nodes of all levels above ``level``."""
    ...


@wp.func_native("return tiling::all_densities((const double*)field, elements);")
def are_densities(elements: wp.int32, field: Address) -> wp.bool:
    """Whether no value of a field is negative, infinite or NaN."""
    ...


@wp.func_native("tiling::sum_nodes(field_level, level_low, (const double*)density, (double*)sums);")
def sum_nodes(field_level: wp.int32, level_low: wp.int32, density: Address, sums: Address):
    """Computes the integrals over all nodes above the elements."""
    ...


@wp.func_native("return ranking::count_above((const double*)value, count, bound);")
def count_exceeding(value: Address, count: wp.int32, bound: wp.float64) -> wp.int32:
    """Number of values above the bound."""
    ...


@wp.func_native(
    """
    tiling::mark_splits(count, (const ranking::Key*)key, (const long long*)order, threshold, ties,
                        (unsigned char*)split);
    """
)
def mark_splits(count: wp.int32, key: Address, order: Address, threshold: wp.uint64, ties: wp.int32, split: Address):
    """Marks the nodes above the threshold, and the first ``ties`` of those at it in the order for equal nodes."""
    ...


@wp.func_native(
    """
    return tiling::emit_tiles(level_low, level_high, (const unsigned char*)split, (long long*)level,
                              (long long*)index);
    """
)
def emit_tiles(level_low: wp.int32, level_high: wp.int32, split: Address, level: Address, index: Address) -> wp.int32:
    """Lists the nodes that are not split, in Morton order. Returns their number."""
    ...


@wp.func_native(
    """
    account::sum(elements, fast, (const double*)spatial, (const double*)temporal, (const float*)error_spatial,
                 (const float*)error_temporal, (const double*)newest_s, (const int*)part_of_element, (double*)result);
    """
)
def sum_account(
    elements: wp.int32,
    fast: wp.float64,
    spatial: Address,
    temporal: Address,
    error_spatial: Address,
    error_temporal: Address,
    newest_s: Address,
    part_of_element: Address,
    result: Address,
):
    """Computes the combined density over the field, the spread of ages in elements of fast refresh, and the number of
    non-finite values of the four fields."""
    ...
