"""Reflectances of surfaces by their indices of refraction."""

from __future__ import annotations

import math

import pytest
from scipy.integrate import quad

from scenes.formats.appearance.indices import mean_reflectance


@pytest.mark.parametrize("ior", [1.0, 1.00005, 1.0001, 1.001, 1.33, 1.5, 2.4, 20.0, 1e40])
def test_mean_reflectance_is_the_integral_of_fresnels_equations(ior: float) -> None:
    def reflected(cosine: float) -> float:
        inside = math.sqrt(1.0 - (1.0 - cosine**2) / ior**2)
        across, along = (
            (cosine - ior * inside) / (cosine + ior * inside),
            (ior * cosine - inside) / (ior * cosine + inside),
        )
        return (across**2 + along**2) * cosine

    expected, _ = quad(reflected, 0.0, 1.0, points=[0.01, 0.1], epsabs=1e-13)
    assert mean_reflectance(ior) == pytest.approx(expected, rel=1e-10, abs=2e-8)
