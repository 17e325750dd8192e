"""Point sets: positions of samples in a pixel and times within the shutter's. Imports nothing large."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

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
