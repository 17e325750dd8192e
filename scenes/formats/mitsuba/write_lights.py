"""Writer of lights of Mitsuba files.

Source: Mitsuba 0.5 documentation; Mitsuba 3 documentation, plugin reference.
"""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence

import numpy as np

from scenes.canonical import DirectionalLight, EnvironmentLight, Light, PointLight, SpotLight, SunSky
from scenes.daylight import facing_up
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.appearance.spot_profiles import reshaped
from scenes.formats.mitsuba.write_materials import MitsubaSurfaceWriter
from scenes.formats.text.numbers import number


class MitsubaLightWriter(MitsubaSurfaceWriter):
    """Collects the elements of lights, materials and textures."""

    def emitters(self, lights: Sequence[Light]) -> None:
        """Writes lights. Mitsuba 3 has one light all around: sun and sky of the same air are joined, others are left
        out, which is reported."""
        around = [light for light in lights if isinstance(light, SunSky | EnvironmentLight)] if self.modern else []
        if len(around) == 2 and all(isinstance(one, SunSky) for one in around):
            parts = {one.part: one for one in around if isinstance(one, SunSky)}
            airs = {dataclasses.replace(one, part="both", scale=1.0) for one in parts.values()}
            if set(parts) == {"sun", "sky"} and len(airs) == 1:
                self._daylight(parts["sun"], {part: one.scale for part, one in parts.items()})
                lights, around = [one for one in lights if not isinstance(one, SunSky)], []
        for light in lights:
            if any(light is one for one in around[1:]):
                self.report.add("light", "a further light all around")
            else:
                self.emitter(light)

    def emitter(self, light: Light) -> None:
        """Writes a light."""
        if isinstance(light, PointLight):
            made = self.plugin("emitter", "point", self.root)
            place = {axis: number(value) for axis, value in zip("xyz", light.position, strict=True)}
            ElementTree.SubElement(made, "point", {"name": "position", **place})
            self.color(made, "intensity", light.intensity)
        elif isinstance(light, SpotLight):
            light = reshaped(light, "linear", self.report)
            made = self.plugin("emitter", "spot", self.root)
            holder = ElementTree.SubElement(made, "transform", {"name": self.name("toWorld")})
            ends = {name: ", ".join(number(value) for value in point) for name, point in
                    (("origin", light.position), ("target", light.target))}  # fmt: skip
            forward = np.subtract(light.target, light.position)
            up = np.eye(3)[int(np.abs(forward).argmin())]
            ElementTree.SubElement(holder, "lookat", {**ends, "up": ", ".join(number(value) for value in up)})
            self.color(made, "intensity", light.intensity)
            self.put(made, "float", "cutoffAngle", number(light.outer_deg))
            self.put(made, "float", "beamWidth", number(light.inner_deg))
        elif isinstance(light, DirectionalLight):
            if light.angle_deg:
                self.report.add("light", f"a sun of {light.angle_deg:g} degrees", "a parallel light")
            made = self.plugin("emitter", "directional", self.root)
            way = {axis: number(value) for axis, value in zip("xyz", light.direction, strict=True)}
            ElementTree.SubElement(made, "vector", {"name": "direction", **way})
            self.color(made, "irradiance", light.irradiance)
        elif isinstance(light, SunSky):
            self._daylight(light)
        elif light.image.shape[:2] == (1, 1):
            made = self.plugin("emitter", "constant", self.root)
            self.color(made, "radiance", rgb(light.scale * light.image[0, 0].astype(np.float64)))
        else:
            made = self.plugin("emitter", "envmap", self.root)
            self.put(made, "string", "filename", self.output.picture(light.image, light.source))
            self.put(made, "float", "scale", number(light.scale))
            self.matrix(made, "toWorld", light.to_world)

    def _daylight(self, light: SunSky, scales: Mapping[str, float] | None = None) -> None:
        """Writes sun and sky in world directions; the transform rotates the zenith (y, or z in Mitsuba 3)."""
        kind = "sunsky" if self.modern or light.part == "both" else light.part
        made = self.plugin("emitter", kind, self.root)
        way = {axis: number(value) for axis, value in zip("xyz", light.sun_direction, strict=True)}
        ElementTree.SubElement(made, "vector", {"name": self.name("sunDirection"), **way})
        air = light
        if self.modern and not 1.0 <= light.turbidity <= 10.0:
            air = dataclasses.replace(light, turbidity=min(max(light.turbidity, 1.0), 10.0))
            self.report.add("light", f"a turbidity of {light.turbidity:g}", f"{air.turbidity:g}")
        self.put(made, "float", "turbidity", number(air.turbidity))
        self.color(made, "albedo", grey(light.ground_albedo))
        if self.modern:
            for part in ("sun", "sky"):
                own = light.scale if light.part in (part, "both") else 0.0
                self.put(made, "float", f"{part}Scale", number(scales[part] if scales else own))
        else:
            self.put(made, "float", "scale", number(light.scale))
        turn = facing_up(light.up, 2 if self.modern else 1)
        if not np.array_equal(turn, np.eye(4)):
            self.matrix(made, "toWorld", turn)
