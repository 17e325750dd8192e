"""The fall-off of spot lights in each renderer, and conversion between the profiles.

Source: PBRT v3 (Pharr, Jakob and Humphreys 2016, sec. 12.3.1); Mitsuba 0.5 documentation, section on spot lights; the
fall-off that the glTF extension KHR_lights_punctual recommends;
``renderer/kernels/lights.py`` for this project's renderer. The fall-off of LuxCore 2.10 is that of PBRT divided by the
cosine (measured in ``tests/scenes/formats/test_light.py``).
"""

from __future__ import annotations

import dataclasses
import math

from scipy.optimize import brentq

from scenes.arithmetic import cos, log, log1p, sin
from scenes.canonical import SpotLight
from scenes.canonical.values import Rgb
from scenes.formats.losses import LossReport

_NAMES = {
    "hermite": "by Hermite's polynomial in the cosine",
    "quartic": "by the fourth power in the cosine",
    "linear": "linearly in the angle",
    "secant": "by the fourth power in the cosine, over the cosine",
    "quadratic": "by the square in the cosine",
}

_SHARES = {"hermite": 0.5, "quartic": 0.2, "quadratic": 1.0 / 3.0}
"""Mean of the profile from the edge to the full intensity, over the cosine."""


def flux(profile: str, inner_deg: float, outer_deg: float) -> float:
    """Power of a spot light of unit intensity, from its axis to its edge, over 2π."""
    low, high = cos(math.radians(outer_deg)), cos(math.radians(inner_deg))
    if outer_deg - inner_deg < 1e-6:
        return -log(low) if profile == "secant" else 1.0 - low
    if profile == "linear":
        inner, outer = math.radians(inner_deg), math.radians(outer_deg)
        return 1.0 - (sin(outer) - sin(inner)) / (outer - inner)
    if profile == "secant":
        # integral of x⁴ / c over the cosine c, with x = (c - low) / (high - low)
        return _quartic_over(low / (high - low)) - log(high)
    return 1.0 - high + _SHARES[profile] * (high - low)


def _quartic_over(ratio: float) -> float:
    """The integral of ``x⁴ / (x + ratio)`` from 0 to 1, by polynomial division; for large ratios, where that suffers
    from cancellation, by a series in powers of ``-1 / ratio``."""
    if ratio < 4.0:
        return 0.25 - ratio * (1.0 / 3.0 - ratio * (0.5 - ratio * (1.0 - ratio * log1p(1.0 / ratio))))
    total = 0.0
    for power in range(33, 4, -1):
        total = 1.0 / power - total / ratio
    return total / ratio


def _narrower(light: SpotLight) -> SpotLight:
    """The spot light with a cone narrow enough to exclude cosines of zero."""
    outer = min(light.outer_deg, 89.0)
    return dataclasses.replace(light, inner_deg=min(light.inner_deg, outer), outer_deg=outer)


def reshaped(light: SpotLight, profile: str, report: LossReport) -> SpotLight:
    """The spot light with another profile, the same edge and the same power; a change is reported.

    The inner angle is changed to keep the power. If no angle keeps it, the intensity is changed.
    """
    sharp = light.inner_deg == light.outer_deg and "secant" not in (light.profile, profile)
    if light.profile == profile or sharp:
        return dataclasses.replace(light, profile=profile)  # type: ignore[arg-type]
    light = _narrower(light) if "secant" in (light.profile, profile) else light
    wanted, outer = flux(light.profile, light.inner_deg, light.outer_deg), light.outer_deg

    def surplus(inner_deg: float) -> float:
        return flux(profile, inner_deg, outer) - wanted

    least, most = surplus(0.0), surplus(outer)
    if least < 0.0 < most:
        inner, scale = float(brentq(surplus, 0.0, outer, full_output=False)), 1.0  # type: ignore[arg-type]
    else:
        inner = 0.0 if least >= 0.0 else outer
        scale = wanted / flux(profile, inner, outer)
    intensity: Rgb = light.intensity if scale == 1.0 else tuple(scale * part for part in light.intensity)  # type: ignore[assignment]
    report.add("light", f"a spot that falls off {_NAMES[light.profile]}", f"{_NAMES[profile]}, of the same power")
    return dataclasses.replace(light, intensity=intensity, inner_deg=inner, profile=profile)
