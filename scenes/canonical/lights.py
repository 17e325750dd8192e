"""The lights of the canonical scene; its conventions are in :mod:`scenes.canonical`.

Source: Hagemann 2018, table 4.1.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenes.canonical.values import Matrix, Rgb, identity


@dataclass(frozen=True)
class PointLight:
    """Radiant intensity (per steradian) at a position."""

    position: Rgb
    intensity: Rgb


@dataclass(frozen=True)
class DirectionalLight:
    """Parallel light that travels along ``direction``; ``irradiance`` on a surface facing it.

    Attributes:
        direction: direction of travel, from the light into the scene; need not be a unit vector.
        angle_deg: full angle of the cone that the light fills (0.53 for the sun's disk), zero for hard shadows.
    """

    direction: Rgb
    irradiance: Rgb
    angle_deg: float = 0.0


@dataclass(frozen=True)
class SpotLight:
    """Intensity within a cone, falling off from ``inner_deg`` to ``outer_deg`` (half angles).

    Attributes:
        intensity: intensity on the axis.
        profile: profile of the fall-off, with ``x`` from 0 at the edge to 1: ``3x² - 2x³`` or ``x⁴`` in the cosine,
            ``x`` in the angle, (``secant``) ``x⁴`` in the cosine with the whole light divided by the cosine, or
            (``quadratic``) ``x²`` in the cosine. The renderer supports the first.
    """

    position: Rgb
    target: Rgb
    intensity: Rgb
    inner_deg: float
    outer_deg: float
    profile: Literal["hermite", "quartic", "linear", "secant", "quadratic"] = "hermite"


@dataclass(frozen=True, eq=False)
class EnvironmentLight:
    """Radiance from infinity: an image, or a constant if the image has one texel.

    Among the lights of a scene it lights surfaces and is visible; as the background it is only visible.

    Attributes:
        image: ``(height, width, 3)`` float32 linear RGB, latitude–longitude.
        to_world: rotation of the map, ``(4, 4)``.
        scale: factor of the image.
    """

    image: NDArray[np.float32]
    to_world: Matrix = field(default_factory=identity)
    scale: float = 1.0
    source: str = ""


@dataclass(frozen=True)
class SunSky:
    """Analytic daylight (:mod:`scenes.daylight`).

    Attributes:
        sun_direction: direction towards the sun, in the world.
        turbidity: turbidity of the air, 1 (clear) to 10 (hazy).
        scale: factor of the radiance, which is in W m⁻² sr⁻¹ nm⁻¹ at a scale of 1.
        part: part that emits light.
        up: direction towards the zenith, in the world.
        ground_albedo: albedo of the ground, which lights the sky from below, 0 to 1.
    """

    sun_direction: Rgb
    turbidity: float = 3.0
    scale: float = 1.0
    part: Literal["sun", "sky", "both"] = "both"
    up: Rgb = (0.0, 0.0, 1.0)
    ground_albedo: float = 0.15


Light = PointLight | DirectionalLight | SpotLight | EnvironmentLight | SunSky
