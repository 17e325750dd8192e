"""Geometric primitives of USD as shapes of the canonical scene.

Source: OpenUSD documentation, UsdGeom (Sphere, Cube, Cylinder, Cone, Capsule, Plane).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import cos, product, sin
from scenes.canonical import Cube, Matrix, Mesh, Rectangle, SceneError, Shape, Sphere
from scenes.formats.geometry.orientation import turned
from scenes.formats.geometry.revolution import cone, cylinder, revolved, ring

KINDS = ("Sphere", "Cube", "Cylinder", "Cone", "Capsule", "Plane")
_TURNS = {"X": (1, 2, 0), "Y": (2, 0, 1), "Z": (0, 1, 2)}
_ALONG = 32


def shapes_of(prim: Any, code: Any) -> list[tuple[Shape, Matrix]]:
    """The shapes of a primitive, and their transforms to its space.

    Raises:
        SceneError: a size is not positive.
    """
    kind = prim.GetTypeName()
    size = {name: _size(prim, name, code) for name in ("radius", "height", "size", "width", "length")}
    matrix = np.eye(4)
    if kind == "Sphere":
        return [(Sphere(size["radius"]), matrix)]
    if kind == "Cube":
        return [(Cube(), np.diag([*(3 * [size["size"] / 2.0]), 1.0]))]
    axis = prim.GetAttribute("axis").Get() or "Z"
    turn = np.eye(4)
    turn[:3, :3] = np.eye(3)[list(_TURNS[str(axis)])].T
    if kind == "Plane":  # the width lies along x and the length along y, or along the axis that the normal replaces
        sides = {"X": (size["length"], size["width"]), "Y": (size["length"], size["width"])}
        first, second = sides.get(str(axis), (size["width"], size["length"]))
        return [(Rectangle(), product(turn, np.diag([first / 2.0, second / 2.0, 1.0, 1.0])))]
    radius, half = size["radius"], size["height"] / 2.0
    below = turned(ring(radius, 0.0, -half))
    if kind == "Cylinder":
        return [(mesh, turn) for mesh in (cylinder(radius, -half, half), ring(radius, 0.0, half), below)]
    if kind == "Cone":
        side = cone(radius, 2.0 * half)
        down = np.eye(4)
        down[2, 3] = -half
        return [(side, product(turn, down)), (below, turn)]
    return [(_capsule(radius, half), turn)]


def _capsule(radius: float, half: float) -> Mesh:
    """A cylinder with half spheres at its ends."""

    def profile(v: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        at = 3.0 * v
        low, high = np.clip(at, 0.0, 1.0), np.clip(at - 2.0, 0.0, 1.0)
        theta = math.pi / 2.0 * (high - (1.0 - low))
        return radius * cos(theta), radius * sin(theta) + half * (2.0 * np.clip(at - 1.0, 0.0, 1.0) - 1.0)

    return revolved(profile, 3 * (_ALONG // 2), source="capsule")


def _size(prim: Any, name: str, code: Any) -> float:
    attribute = prim.GetAttribute(name)
    value = attribute.Get(code) if attribute else None
    if value is None:
        return 1.0
    if not 0.0 < float(value) < math.inf:
        raise SceneError(f"cannot be read: {prim.GetName()}: expected a positive {name}, got {value}")
    return float(value)
