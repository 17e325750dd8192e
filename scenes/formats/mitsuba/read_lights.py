"""Lights of Mitsuba 0.5, converted to the canonical scene.

Source: Mitsuba 0.5 documentation, section on emitters.
"""

from __future__ import annotations

import numpy as np

from scenes import loading
from scenes.arithmetic import norm, product
from scenes.canonical import (
    DirectionalLight,
    EnvironmentLight,
    Light,
    PointLight,
    SceneError,
    SpotLight,
    SunSky,
)
from scenes.canonical.values import Matrix
from scenes.daylight import sun_at
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.geometry.conventions import turned_map
from scenes.formats.geometry.orientation import scales_evenly
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.properties import Properties
from scenes.formats.text.scene_files import SceneFiles
from scenes.formats.text.xml_tree import XmlNode

_TIME_AND_PLACE = ("year", "month", "day", "hour", "minute", "second", "latitude", "longitude", "timezone")


class MitsubaLights:
    """Creates lights from elements."""

    def __init__(self, files: SceneFiles, report: LossReport) -> None:
        self.files, self.report = files, report
        self.lights: list[Light] = []

    def read(self, node: XmlNode) -> None:
        """Reads an emitter outside of shapes."""
        kind, properties = node.get("type"), Properties(node, self.report)
        matrix = properties.transform()
        if kind == "point":
            place = product(matrix, np.append(properties.vector("position", grey(0.0)), 1.0))
            self.lights.append(PointLight(rgb(place[:3]), properties.color("intensity", grey(1.0))))
        elif kind == "spot":
            outer = properties.number("cutoffAngle", 20.0)
            inner = properties.number("beamWidth", 0.75 * outer)
            ends = rgb(matrix[:3, 3]), rgb(matrix[:3, 3] + matrix[:3, 2] / norm(matrix[:3, 2]))
            if any(child.tag in ("texture", "ref") for child in properties.rest):
                self.report.add(properties.where, "a picture in a spot light", "none")
                properties.asked.update(child.get("name") for child in properties.rest)
            if not scales_evenly(matrix[:3, :3]):
                self.report.add(properties.where, "a spot light that a transform stretches", "a round one")
            self.lights.append(SpotLight(*ends, properties.color("intensity", grey(1.0)), inner, outer, "linear"))
        elif kind in ("directional", "collimated"):
            direction = properties.vector("direction", rgb(matrix[:3, 2]))
            if not norm(direction) > 0.0:
                raise SceneError(f"{properties.where}: direction: expected one")
            if kind == "collimated":
                self.report.add(properties.where, "a beam of no width", "a parallel light")
            unit = rgb(direction / norm(direction))
            # Mitsuba does not shorten the axis of the transform (measured with 3.9)
            bright = 1.0 if "direction" in properties else norm(direction)
            irradiance = rgb(bright * np.array(properties.color("irradiance", grey(1.0))))
            self.lights.append(DirectionalLight(unit, irradiance))
        elif kind == "constant":
            radiance = properties.color("radiance", grey(1.0))
            self.lights.append(EnvironmentLight(np.array([[list(radiance)]], np.float32)))
        elif kind == "envmap":
            name, scale = properties.text("filename", ""), properties.number("scale", 1.0)
            path = self.files.known(name, properties.where, self.report, f"the picture {name!r}", "even light")
            if abs(norm(matrix[:3, 1]) - 1.0) > 1e-4:  # Mitsuba 3.9 looks up directions that are not of length 1
                self.report.add(properties.where, "an environment map that its transform scales", "one of its own size")
            image = np.ones((1, 1, 3), np.float32) if path is None else loading.read_image(path)
            self.lights.append(EnvironmentLight(image, turned_map(matrix), scale, str(path or "")))
        elif kind in ("sun", "sky", "sunsky"):
            self._daylight(kind, properties, matrix)
        elif kind == "area":
            raise SceneError(f"{node.place}: area: expected it inside a shape")
        else:
            properties.asked.update(properties.given)
            self.report.unknown(node.place, "emitter", kind)
        if "samplingWeight" in properties:
            self.report.hint(properties.where, "samplingWeight of a light", "the renderer's own choice")
            properties.asked.add("samplingWeight")
        properties.left_over()

    def _daylight(self, kind: str, properties: Properties, matrix: Matrix) -> None:
        turned = matrix[:3, :3]
        direction = properties.vector("sunDirection", (0.0, 1.0, 0.0))
        if "sunDirection" not in properties:
            direction = product(turned, self._by_time(properties))
        if not norm(direction) > 0.0:
            raise SceneError(f"{properties.where}: sunDirection: expected a direction")
        unit, up = rgb(direction / norm(direction)), rgb(turned[:, 1] / norm(turned[:, 1]))
        turbidity, scale = properties.number("turbidity", 3.0), properties.number("scale", 1.0)
        albedo = float(np.mean(properties.color("albedo", grey(0.15))))
        shares = {part: properties.number(f"{part}Scale", 1.0) if kind == "sunsky" else 1.0 for part in ("sun", "sky")}
        if kind != "sunsky" or shares["sun"] == shares["sky"]:
            part = "both" if kind == "sunsky" else kind
            factor = scale * (shares["sky"] if kind == "sunsky" else 1.0)
            self.lights.append(SunSky(unit, turbidity, factor, part, up, albedo))  # type: ignore[arg-type]
            return
        for part, share in shares.items():
            if share == 0.0:
                continue
            self.lights.append(SunSky(unit, turbidity, scale * share, part, up, albedo))  # type: ignore[arg-type]

    def _by_time(self, properties: Properties) -> np.ndarray:
        """Direction towards the sun, from date and location; east is x, north is -z."""
        names = zip(_TIME_AND_PLACE, (2010, 7, 10, 15, 0, 0, 35.6894, 139.6917, 9), strict=True)
        values = {name: properties.number(name, default) for name, default in names}
        hour = values["hour"] + values["minute"] / 60.0 + values["second"] / 3600.0
        date = int(values["year"]), int(values["month"]), int(values["day"])
        try:
            east, north, up = sun_at(date, hour, values["latitude"], values["longitude"], values["timezone"])
        except (ValueError, OverflowError) as error:
            raise SceneError(f"{properties.where}: expected a date and time, got {error}") from None
        self.report.add(properties.where, "the sun's place by time and latitude", "its direction, x to the east")
        return np.array([east, up, -north])
