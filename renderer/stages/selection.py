"""Selection in C++ (``native/selection.h``): passes over the field and over the tiles. ``kernels.py`` combines them;
the definition is in ``tsar/selection.py``."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


@wp.struct
class SelectionPlan:
    """Parameters of the selection."""

    batch: wp.int32
    field_level: wp.int32
    samples: wp.int32
    centre: wp.uint64
    """float32: offsets of a tile's samples, in tile widths."""


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
    """Updates the credit of every element, and computes its mean over every tile."""
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
    """Selects the tiles above the threshold and the first ``ties`` of those at it, and subtracts a refresh from their
    credit."""
    ...


@wp.func_native("selection::place_framelets(plan, (const long long*)level, (const long long*)index, due);")
def place_framelets(plan: SelectionPlan, level: Address, index: Address, due: Due):
    """Stores the tiles of a batch and the positions of its samples."""
    ...
