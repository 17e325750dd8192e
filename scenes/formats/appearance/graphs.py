"""Textures and materials as graphs: shared parts are visited once, and the depth is bounded."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

from scenes.canonical import Material, SceneError, Texture

NESTED_MAX = 64
"""Maximum depth of nested textures or materials."""

Answer = TypeVar("Answer")
Visit = Callable[[Any, Callable[[Any], Answer]], Answer]


def once_a_node(visit: Visit[Answer], root: Any) -> Answer:
    """The result of a visit of a graph. ``visit`` is called once for each node, with a function that visits other
    nodes."""
    found: dict[int, tuple[Any, Answer]] = {}

    def again(node: Any) -> Answer:
        if id(node) not in found:
            found[id(node)] = node, visit(node, again)  # the node is kept alive, so that its id is not reused
        return found[id(node)][1]

    return again(root)


def parts_of(node: Any) -> list[Any]:
    """Textures and materials that a texture or material contains."""
    values = [getattr(node, name) for name in _names(type(node))]
    return [value for value in values if hasattr(value, "__dataclass_fields__")]


@cache
def _names(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(kind))


def check_depth(part: Texture | Material, where: str) -> None:
    """Raises SceneError if textures or materials are nested too deeply; their parts have been checked."""
    depth = once_a_node(lambda node, again: 1 + max(map(again, parts_of(node)), default=0), part)
    if depth > NESTED_MAX:
        raise SceneError(f"{where}: expected at most {NESTED_MAX} textures or materials inside each other")
