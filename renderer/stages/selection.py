"""Selection in C++ (``native/selection.h``): passes over the field and over the tiles. They are put together in
``kernels.py``; the definition is in ``tsar/selection.py``."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


@wp.struct
class SelectionPlan:
    """What of the configuration the selection depends on."""

    batch: wp.int32
    field_level: wp.int32
    samples: wp.int32
    centre: wp.uint64
    """Address of the offsets of a tile's samples, in tile widths."""


@wp.struct
class Due:
    """Addresses of a request's tensors."""

    selected: wp.uint64
    history: wp.uint64
    level: wp.uint64
    index: wp.uint64
    position: wp.uint64


@wp.func_native(
    """
    selection::gather_credit(tiles, field_level, (const long long*)level, (const long long*)index,
                             (const double*)temporal, (const double*)history, (double*)overdue, (double*)credit);
    """
)
def gather_credit(
    tiles: wp.int32,
    field_level: wp.int32,
    level: Address,
    index: Address,
    temporal: Address,
    history: Address,
    overdue: Address,
    credit: Address,
):
    """Credit of every element, and its mean over every tile."""
    ...


@wp.func_native(
    """
    selection::refresh_due(tiles, field_level, (const long long*)level, (const long long*)index,
                           (const double*)overdue, (const ranking::Key*)key, threshold, ties, due);
    """
)
def refresh_due(
    tiles: wp.int32,
    field_level: wp.int32,
    level: Address,
    index: Address,
    overdue: Address,
    key: Address,
    threshold: wp.uint64,
    ties: wp.int32,
    due: Due,
):
    """Tiles above the threshold, and the ``ties`` first of those at it; a refresh is taken off their credit."""
    ...


@wp.func_native("selection::place_framelets(plan, (const long long*)level, (const long long*)index, due);")
def place_framelets(plan: SelectionPlan, level: Address, index: Address, due: Due):
    """The tiles of a batch, and the positions of its samples."""
    ...
