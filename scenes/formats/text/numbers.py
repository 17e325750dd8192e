"""Numbers as text: their format, and the bound of numbers that are read."""

from __future__ import annotations

from collections.abc import Iterable

from scenes.canonical.values import Matrix

NUMBER_MAX = 1e30
"""Greatest magnitude of a number in a scene file; products of larger ones overflow float32."""


def number(value: float) -> str:
    """A number with nine significant digits, as float32 needs."""
    return f"{float(value):.9g}"


def spaced(values: Iterable[float]) -> str:
    """Float64 numbers with all digits, separated by spaces."""
    return " ".join([repr(float(value)) for value in values])


def listed(values: Iterable[float]) -> str:
    """Numbers in brackets, with nine digits each."""
    return f"[ {' '.join(number(value) for value in values)} ]"


def written_matrix(matrix: Matrix) -> str:
    """Sixteen numbers in brackets, column by column, with all digits."""
    return f"[ {spaced(matrix.T.ravel())} ]"
