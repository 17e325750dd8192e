"""Comparison of two scenes, and the place where they differ."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

_NOT_COMPARED = ("source", "name", "materials", "filename")


def difference(
    first: Any, second: Any, tolerance: float = 1e-5, where: str = "scene", alike: set[tuple[int, int]] | None = None
) -> str | None:
    """The first place where two scenes, or parts of them, differ; None if they are equal.

    Names, source files of parts, and unused named materials are ignored. Numbers may differ by ``tolerance`` relative
    to their magnitude, or to that of their array. ``alike`` holds the pairs that have been compared.
    """
    alike = set() if alike is None else alike
    if dataclasses.is_dataclass(first) and not isinstance(first, type):
        if type(first) is not type(second):
            return f"{where}: {type(first).__name__} and {type(second).__name__}"
        if (id(first), id(second)) in alike:
            return None
        for part in dataclasses.fields(first):
            if part.name not in _NOT_COMPARED:
                values = getattr(first, part.name), getattr(second, part.name)
                found = difference(*values, tolerance, f"{where}.{part.name}", alike)
                if found:
                    return found
        alike.add((id(first), id(second)))
        return None
    if isinstance(first, tuple) and isinstance(second, tuple) and not _numeric(first):
        if len(first) != len(second):
            return f"{where}: {len(first)} and {len(second)} parts"
        found = (
            difference(a, b, tolerance, f"{where}[{n}]", alike)
            for n, (a, b) in enumerate(zip(first, second, strict=True))
        )
        return next(filter(None, found), None)
    if (first is None) != (second is None):
        return f"{where}: only one is there"
    if isinstance(first, float | np.ndarray) or _numeric(first):
        a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
        if a.shape != b.shape:
            return f"{where}: shapes {a.shape} and {b.shape}"
        size = max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0))
        if not (np.abs(a - b) <= tolerance * size + 1e-12).all():
            return f"{where}: {np.abs(a - b).max():g} apart, of {size:g}"
        return None
    return None if first == second else f"{where}: {first!r} and {second!r}"


def _numeric(value: Any) -> bool:
    return isinstance(value, tuple) and bool(value) and all(isinstance(part, float) for part in value)
