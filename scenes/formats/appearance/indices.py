"""Indices of refraction, and what surfaces reflect of light that arrives along the normal."""

from __future__ import annotations

import numpy as np

from scenes.canonical import Rgb
from scenes.formats.appearance.spectra import grey, rgb


def index_of_reflectance(reflectance: Rgb) -> tuple[Rgb, Rgb]:
    """The real index of refraction with a reflectance ``r`` at normal incidence: ``(1 + √r) / (1 - √r)``."""
    root = np.sqrt(np.clip(reflectance, 0.0, 0.9999))
    return rgb((1.0 + root) / (1.0 - root)), grey(0.0)


def mean_reflectance(ior: float) -> float:
    """What a smooth dielectric reflects of even light from outside: ``∫ 2 F(c) c dc`` over the cosine ``c``.

    Args:
        ior: index of refraction of the inside over the outside, above 1.

    Source: Fresnel's equations for light without polarization.
    """
    x, weights = np.polynomial.legendre.leggauss(64)
    cosine = 0.5 + 0.5 * x
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / ior**2)
    across = ((cosine - ior * inside) / (cosine + ior * inside)) ** 2
    along = ((ior * cosine - inside) / (ior * cosine + inside)) ** 2
    return float((weights * 0.5 * (across + along) * cosine).sum())


def reflectance_of_index(eta: Rgb, k: Rgb) -> Rgb:
    """What a conductor reflects at normal incidence: ``((eta - 1)² + k²) / ((eta + 1)² + k²)`` (Fresnel)."""
    n, absorbed = np.array(eta), np.array(k)
    return rgb(((n - 1.0) ** 2 + absorbed**2) / ((n + 1.0) ** 2 + absorbed**2))
