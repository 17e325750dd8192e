"""How spot lights fall off towards their edges in each renderer, and how one profile becomes another.

Source: PBRT v3 (Pharr, Jakob and Humphreys 2016, sec. 12.3.1), which LuxRender shares; Mitsuba 0.5 documentation,
section on spot lights; :mod:`renderer.kernels.lights` for this project's.
"""

from __future__ import annotations

import dataclasses
import math

from scipy.optimize import brentq

from scenes.arithmetic import cos, sin
from scenes.canonical import SpotLight
from scenes.canonical.values import Rgb
from scenes.formats.losses import LossReport

_NAMES = {
    "hermite": "by Hermite's polynomial in the cosine",
    "quartic": "by the fourth power in the cosine",
    "linear": "linearly in the angle",
}


def flux(profile: str, inner_deg: float, outer_deg: float) -> float:
    """Power of a spot of unit intensity over 2π, from its axis to its edge."""
    low, high = cos(math.radians(outer_deg)), cos(math.radians(inner_deg))
    if outer_deg - inner_deg < 1e-6:
        return 1.0 - low
    if profile == "linear":
        inner, outer = math.radians(inner_deg), math.radians(outer_deg)
        return 1.0 - (sin(outer) - sin(inner)) / (outer - inner)
    share = 0.5 if profile == "hermite" else 0.2
    return 1.0 - high + share * (high - low)


def reshaped(light: SpotLight, profile: str, report: LossReport) -> SpotLight:
    """The spot light with another profile, the same edge and the same power; a change is reported.

    The inner angle is changed so that the power stays. Where no angle does that, the intensity is changed.
    """
    if light.profile == profile or light.inner_deg == light.outer_deg:
        return dataclasses.replace(light, profile=profile)
    wanted, outer = flux(light.profile, light.inner_deg, light.outer_deg), light.outer_deg

    def surplus(inner_deg: float) -> float:
        return flux(profile, inner_deg, outer) - wanted

    least = surplus(0.0)
    inner = 0.0 if least >= 0.0 else float(brentq(surplus, 0.0, outer, full_output=False))  # type: ignore[arg-type]
    scale = wanted / flux(profile, inner, outer)
    intensity: Rgb = tuple(scale * part for part in light.intensity) if least > 0.0 else light.intensity  # type: ignore[assignment]
    report.add("light", f"a spot that falls off {_NAMES[light.profile]}", f"{_NAMES[profile]}, of the same power")
    return dataclasses.replace(light, intensity=intensity, inner_deg=inner, profile=profile)
