"""Point sets: positions of samples in a pixel and times within the shutter's. Imports nothing large."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import TYPE_CHECKING

from tsar.checks import require
from tsar.named import Named

if TYPE_CHECKING:
    import numpy as np

    from renderer.sampling.point_sets import Points

    Make = Callable[[int, np.random.Generator], Points]

_OWN = ("hammersley", "stratified", "poisson", "halton", "sobol", "owen", "cells-even", "cells-space", "cells-time")

POINT_SETS: Named[Make] = Named(
    "point set",
    "tsar.point_sets",
    {name: f"renderer.sampling.point_sets:{name.replace('-', '_')}" for name in (*_OWN, "random")},
)
"""Functions ``(count, generator) -> points`` ``(count, 3)``: u, v and t in [0, 1)."""


COUNT_MAX = 1 << 16
"""Greatest number of points of a set."""
_POISSON_MAX = 4096


def require_point_set(name: str, count: int) -> None:
    """Checks the name of a point set, and that it can have so many points, without making them.

    Raises:
        ConfigError: it is not known, or cannot have them.
    """
    POINT_SETS.require(name, "point_set")
    most = _POISSON_MAX if name == "poisson" else COUNT_MAX
    require(1 <= count <= most, "samples", f"1 to {most} for the point set {name}", count)
    if name == "stratified":
        cubes = [side * side * side for side in range(1, 42)]  # up to beyond COUNT_MAX
        near = next(pair for pair in itertools.pairwise(cubes) if count < pair[1])
        expected = f"a cube for the point set {name}, such as {near[0]} or {near[1]}"
        require(near[0] == count, "samples", expected, count)
