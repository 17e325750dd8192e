"""Results that are kept as long as the shape that they are made of."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from scenes.canonical import Shape

_Kind = TypeVar("_Kind", bound=Shape)
_Found = TypeVar("_Found")


def kept_with_shape(made: Callable[[_Kind], _Found]) -> Callable[[_Kind], _Found]:
    """The function, whose result is kept as long as its shape lives.

    Shapes that share a mesh then share what is made of it, and the memory of large meshes is freed. The result must not
    refer to the shape.
    """
    kept: WeakKeyDictionary[_Kind, _Found] = WeakKeyDictionary()

    @wraps(made)
    def found(shape: _Kind) -> _Found:
        if shape not in kept:
            kept[shape] = made(shape)
        return kept[shape]

    return found
