"""Refractive indices, and the reflectance of surfaces at normal incidence."""

from __future__ import annotations

import numpy as np

from scenes.arithmetic import log
from scenes.canonical import Rgb
from scenes.formats.appearance.spectra import grey, rgb


def index_of_reflectance(reflectance: Rgb) -> tuple[Rgb, Rgb]:
    """The real refractive index with a reflectance ``r`` at normal incidence: ``(1 + √r) / (1 - √r)``."""
    root = np.sqrt(np.clip(reflectance, 0.0, 0.9999))
    return rgb((1.0 + root) / (1.0 - root)), grey(0.0)


def mean_reflectance(ior: float) -> float:
    """External diffuse reflectance of a smooth dielectric: ``∫ 2 F(c) c dc`` over the cosine ``c``.

    Args:
        ior: refractive index of the inside over that of the outside, above 1.

    Source: Walsh's integral of Fresnel's equations for light without polarization (Prahl 1988, "Light transport in
    tissue", eq. B41). Near an index of 1, where its terms cancel, the first term of its series is used.
    """
    if ior < 1.0001:
        return (ior - 1.0) / 3.0
    ior = min(ior, 1e15)
    square = ior * ior
    plus, minus = square + 1.0, square * square - 1.0
    return (
        0.5
        + (ior - 1.0) * (3.0 * ior + 1.0) / (6.0 * (ior + 1.0) * (ior + 1.0))
        + square * (square - 1.0) * (square - 1.0) / (plus * plus * plus) * log((ior - 1.0) / (ior + 1.0))
        - 2.0 * square * ior * (square + 2.0 * ior - 1.0) / (plus * minus)
        + 8.0 * square * square * (square * square + 1.0) / (plus * minus * minus) * log(ior)
    )


def reflectance_of_index(eta: Rgb, k: Rgb) -> Rgb:
    """Reflectance of a conductor at normal incidence: ``((eta - 1)² + k²) / ((eta + 1)² + k²)`` (Fresnel)."""
    n, absorbed = np.array(eta), np.array(k)
    return rgb(((n - 1.0) ** 2 + absorbed**2) / ((n + 1.0) ** 2 + absorbed**2))
