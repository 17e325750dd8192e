"""A light made of those that the renderer knows: a window, as a grid of points."""

import numpy as np

from scenes.canonical import PointLight


def window(corner, across, up, intensity: float, side: int = 2) -> tuple[PointLight, ...]:
    """``side * side`` points over the parallelogram from ``corner`` along ``across`` and ``up``."""
    steps = (np.arange(side) + 0.5) / side
    places = [np.add(corner, u * np.array(across) + v * np.array(up)) for u in steps for v in steps]
    each = (intensity / side**2,) * 3
    return tuple(PointLight(tuple(place.tolist()), each) for place in places)
