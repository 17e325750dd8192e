"""Cutting procedural meshes along curves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from scenes.driving.meshing import Array, SurfaceMesh, join, unit


def cut(surface: SurfaceMesh, value: Array) -> tuple[SurfaceMesh, SurfaceMesh]:
    """Cuts a surface along the zero line of a function, splitting the triangles it crosses.

    Args:
        surface: surface to cut.
        value: ``(v,)`` values of the function at the vertices, interpolated linearly.

    Returns:
        The part where the function is negative, and the rest; normals and uv are interpolated on the cut.
    """
    value = np.where(np.abs(value) < 1e-9, 1e-9, value)
    below = value < 0.0
    count = below[surface.faces].sum(axis=1)
    inside = [surface.faces[count == 3]]
    outside = [surface.faces[count == 0]]
    crossed = surface.faces[(count == 1) | (count == 2)]
    if len(crossed) == 0:
        return replace(surface, faces=inside[0]).compact(), replace(surface, faces=outside[0]).compact()
    lone = below[crossed] == (below[crossed].sum(axis=1) == 1)[:, None]
    shift = (np.argmax(lone, axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(crossed, shift, axis=1).T  # vertex a is alone on its side
    low, high = np.sort([np.tile(a, 2), np.concatenate([b, c])], axis=0)
    edges, which = np.unique(low * len(value) + high, return_inverse=True)
    low, high = np.divmod(edges, len(value))
    share = (value[low] / (value[low] - value[high]))[:, None]
    fresh = which + len(surface.vertices)
    ab, ac = fresh[: len(a)], fresh[len(a) :]

    def blend(array: Array) -> Array:
        return np.concatenate([array, array[low] * (1.0 - share) + array[high] * share])

    tip = np.stack([a, ab, ac], -1)
    rest = np.concatenate([np.stack([ab, b, c], -1), np.stack([ab, c, ac], -1)])
    tip_below = below[a]
    inside += [tip[tip_below], rest[np.tile(~tip_below, 2)]]
    outside += [tip[~tip_below], rest[np.tile(tip_below, 2)]]
    whole = SurfaceMesh(
        blend(surface.vertices), np.concatenate(inside), unit(blend(surface.normals)), blend(surface.uvs)
    )
    return whole.compact(), replace(whole, faces=np.concatenate(outside)).compact()


def carve(surface: SurfaceMesh, *sides: Callable[[Array], Array]) -> tuple[SurfaceMesh, SurfaceMesh]:
    """Cuts out the part where each of several functions of the vertices ``(v, 3)`` is negative.

    The cuts are made successively, so that corners between them stay sharp.

    Returns:
        The part that was cut out, and the rest.
    """
    inside, rest = surface, []
    for side in sides:
        inside, outside = cut(inside, side(inside.vertices))
        rest.append(outside)
    return inside, join(rest)
