"""Writer of lights of a USD file (UsdLux), and of its lamps that reflect nothing.

Strengths are the product of ``color``, at most 1, and ``intensity``. A point is a small sphere that is treated as a
point, whose normalized radiance is four times its radiant intensity; a directional light is normalized to its
irradiance; lamps have their radiance.

Source: OpenUSD documentation, UsdLux (LightAPI, ShapingAPI, and the light of each kind).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenes.arithmetic import norm, product
from scenes.canonical import (
    ConstantTexture,
    DirectionalLight,
    Disk,
    EnvironmentLight,
    ImageTexture,
    Instance,
    Light,
    Matte,
    PointLight,
    Rectangle,
    Sphere,
    SpotLight,
    SunSky,
)
from scenes.canonical.values import Matrix, Rgb
from scenes.daylight import sky_map, sun_light
from scenes.formats.appearance.spot_profiles import reshaped
from scenes.formats.geometry.orientation import scales_evenly
from scenes.formats.geometry.placing import facing, shines_behind
from scenes.formats.losses import LossReport
from scenes.formats.usd.document import UsdStage
from scenes.models.usd_library import Sdf, UsdLux

_POINT_RADIUS = 1e-3
_WIDEST_DEG = 89.99  # a cone of 90 degrees is none
_BLACK = Matte(ConstantTexture((0.0, 0.0, 0.0)))
_FLAT = np.diag([-1.0, 1.0, -1.0, 1.0])  # flat lights of USD shine along -z, canonical ones along +z


def is_lamp_alone(instance: Instance) -> bool:
    """Whether an instance is a lamp that UsdLux has: a sphere, disk or rectangle that shines on its front alone and
    reflects nothing."""
    round_or_flat = isinstance(instance.shape, Sphere | Disk | Rectangle) and instance.material == _BLACK
    return instance.emission is not None and round_or_flat and not shines_behind(instance)


class UsdLightWriter:
    """Writes lights.

    Args:
        document: file.
        report: receives the losses.
    """

    def __init__(self, document: UsdStage, report: LossReport) -> None:
        self.document, self.report = document, report

    def lamp(self, instance: Instance, path: str, matrix: Matrix) -> None:
        """Writes a lamp (:func:`is_lamp_alone`); its size is that of its transform where that only scales."""
        shape, axes = instance.shape, matrix[:3, :3]
        sizes = [float(norm(axes[:, axis])) for axis in range(3)]
        stage = self.document.stage
        if isinstance(shape, Sphere):
            even = scales_evenly(axes)
            light = UsdLux.SphereLight.Define(stage, path)
            light.CreateRadiusAttr(shape.radius * (sizes[0] if even else 1.0))
            place = matrix if not even else product(matrix, np.diag([*(3 * [1.0 / sizes[0]]), 1.0]))
        else:
            flat = product(matrix, _FLAT)
            square = abs(float((axes[:, 0] * axes[:, 1]).sum())) <= 1e-9 * sizes[0] * sizes[1]
            disk = isinstance(shape, Disk)
            square = square and (not disk or abs(sizes[0] - sizes[1]) <= 1e-9 * sizes[0])
            if square:
                flat = product(flat, np.diag([*(1.0 / size for size in sizes), 1.0]))
            first, second = sizes[:2] if square else (1.0, 1.0)
            if isinstance(shape, Disk):
                light = UsdLux.DiskLight.Define(stage, path)
                light.CreateRadiusAttr(shape.radius * first)
            else:
                light = UsdLux.RectLight.Define(stage, path)
                light.CreateWidthAttr(2.0 * first)
                light.CreateHeightAttr(2.0 * second)
            place = flat
        assert instance.emission is not None
        strengthen(light.GetPrim(), instance.emission)
        self.document.place(light, place)

    def light(self, light: Light) -> None:
        """Writes a light without an area, or an environment."""
        if isinstance(light, SunSky):
            became = {"sun": "a light", "sky": "an environment map"}.get(light.part, "a light and an environment map")
            self.report.add("light", f"a {'sun and sky' if light.part == 'both' else light.part}", became)
            if light.part != "sky":
                self.light(sun_light(light))
            if light.part != "sun":
                self.light(sky_map(light))
        elif isinstance(light, EnvironmentLight):
            self._dome(light)
        elif isinstance(light, DirectionalLight):
            sun = UsdLux.DistantLight.Define(self.document.stage, self.document.path("sun"))
            sun.CreateAngleAttr(light.angle_deg)
            sun.CreateNormalizeAttr(True)
            strengthen(sun.GetPrim(), light.irradiance)
            self.document.place(sun, facing(np.zeros(3), np.array(light.direction)))
        elif isinstance(light, SpotLight):
            spot = reshaped(light, "hermite", self.report)
            if spot.outer_deg > _WIDEST_DEG:
                self.report.add("light", f"a spot of {spot.outer_deg:g} degrees", f"{_WIDEST_DEG:g} degrees")
            outer = min(spot.outer_deg, _WIDEST_DEG)
            direction = np.subtract(spot.target, spot.position)
            made = self._point("spot", spot.intensity, facing(np.array(spot.position), direction))
            shaping = UsdLux.ShapingAPI.Apply(made)
            shaping.CreateShapingConeAngleAttr(outer)
            shaping.CreateShapingConeSoftnessAttr(1.0 - min(spot.inner_deg / outer, 1.0))
        else:
            assert isinstance(light, PointLight)
            place = np.eye(4)
            place[:3, 3] = light.position
            self._point("point", light.intensity, place)

    def _point(self, name: str, intensity: Rgb, place: Matrix) -> Any:
        made = UsdLux.SphereLight.Define(self.document.stage, self.document.path(name))
        made.CreateTreatAsPointAttr(True)
        made.CreateRadiusAttr(_POINT_RADIUS)
        made.CreateNormalizeAttr(True)
        red, green, blue = (4.0 * part for part in intensity)
        strengthen(made.GetPrim(), (red, green, blue))
        self.document.place(made, place)
        return made.GetPrim()

    def _dome(self, light: EnvironmentLight) -> None:
        dome = UsdLux.DomeLight.Define(self.document.stage, self.document.path("environment"))
        self.document.place(dome, light.to_world)
        if light.image.shape[:2] == (1, 1):
            red, green, blue = (light.scale * float(part) for part in light.image[0, 0])
            strengthen(dome.GetPrim(), (red, green, blue))
            return
        strengthen(dome.GetPrim(), (light.scale, light.scale, light.scale))
        texture = ImageTexture(light.image, source=light.source)
        file, space = self.document.picture(texture, numbers=False)
        dome.CreateTextureFileAttr(Sdf.AssetPath(f"./{file}", ""))
        dome.GetTextureFileAttr().SetColorSpace(space)
        dome.CreateTextureFormatAttr("latlong")


def strengthen(prim: Any, strength: Rgb) -> None:
    """Gives a light its intensity, and its colour unless that is white."""
    light, most = UsdLux.LightAPI(prim), max(strength)
    light.CreateIntensityAttr(most)
    if min(strength) != most:
        light.CreateColorAttr(tuple(part / most if most > 0.0 else 1.0 for part in strength))
