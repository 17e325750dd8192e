"""Lights of PBRT v4, converted to the canonical scene.

A light emits its colour times its ``scale``; ``power`` (lumens) and ``illuminance`` (lux) scale it so that a white
light emits that amount.

Source: PBRT v4 file format (https://www.pbrt.org/fileformat-v4), sections on lights and area lights; Pharr, Jakob and
Humphreys 2023, ch. 12.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from scenes import loading
from scenes.arithmetic import cos, norm, product, sin
from scenes.canonical import DirectionalLight, EnvironmentLight, Light, Rgb, SceneError, SpotLight
from scenes.canonical.values import Matrix
from scenes.formats.appearance.equal_area import latitude_longitude
from scenes.formats.appearance.spectra import rgb
from scenes.formats.directives import lights
from scenes.formats.directives.syntax import Parameters
from scenes.formats.losses import LossReport
from scenes.formats.pbrt.v4_materials import PBRT_LUMINANCE, PbrtV4Surfaces
from scenes.formats.text.scene_files import SceneFiles

LightAt = Callable[[Any, tuple[float, float, float]], Rgb]


class V4Lights:
    """Creates lights from parameters."""

    def __init__(self, surfaces: PbrtV4Surfaces, files: SceneFiles, report: LossReport) -> None:
        self.surfaces, self.files, self.report = surfaces, files, report

    def read(self, kind: str, parameters: Parameters, matrix: Matrix, placed: LightAt) -> list[Light]:
        """The lights of a directive; an unknown kind is reported."""
        where = str(parameters.place)
        if "portal" in parameters:
            parameters.asked.add("portal")
            self.report.hint(where, "the portal of a light", "the renderer's own choice")
        start = placed(parameters.numbers("from", 3), (0.0, 0.0, 0.0))
        if kind in ("point", "projection", "goniometric"):
            strength = self._strength(parameters, "I", 4.0 * math.pi)
            return [lights.lamp(kind, parameters, start, strength, self.report)]
        if kind == "spot":
            outer = parameters.number("coneangle", 30.0)
            inner = max(outer - parameters.number("conedeltaangle", 5.0), 0.0)
            # π ((1 - cos inner) + (1 - cos outer)), as the mean of the fall-off in the cosine is 1/2
            whole = math.pi * (2.0 - cos(math.radians(inner)) - cos(math.radians(outer)))
            strength = self._strength(parameters, "I", whole)
            end = placed(parameters.numbers("to", 3), (0.0, 0.0, 1.0))
            return [SpotLight(start, end, strength, inner, outer, "hermite")]
        if kind == "distant":
            strength = self._strength(parameters, "L", 1.0, "illuminance")
            end = placed(parameters.numbers("to", 3), (0.0, 0.0, 1.0))
            direction = np.subtract(end, start)
            if not norm(direction) > 0.0:
                raise SceneError(f"{where}: distant: expected from and to apart")
            return [DirectionalLight(rgb(direction / norm(direction)), strength)]
        if kind == "infinite":
            return [self._infinite(parameters, matrix, where)]
        parameters.asked.update(parameters.given)
        self.report.unknown(where, "light", kind)
        return []

    def _strength(self, parameters: Parameters, name: str, whole: float, by: str = "power") -> Rgb:
        """The colour times its scale; if the power is given, scaled to it by the power of a unit light."""
        factor, given = parameters.number("scale", 1.0), parameters.number(by, -1.0)
        if given > 0.0:
            factor *= given / whole
        return rgb(factor * np.array(self.surfaces.light(parameters, name)))

    def area(self, parameters: Parameters) -> tuple[Rgb, float]:
        """Radiance of an area light, and the power to which it is scaled, 0 for none."""
        where = str(parameters.place)
        strength = rgb(parameters.number("scale", 1.0) * np.array(self.surfaces.light(parameters, "L")))
        both = parameters.truth("twosided", False)
        if "filename" in parameters:
            parameters.asked.add("filename")
            self.report.add(where, "a lamp with a texture", "a constant radiance")
        return strength, max(parameters.number("power", 0.0), 0.0) / (2.0 if both else 1.0)

    def _infinite(self, parameters: Parameters, matrix: Matrix, where: str) -> EnvironmentLight:
        file, light = parameters.text("filename", ""), parameters.number("illuminance", -1.0)
        strength = self._strength(parameters, "L", math.pi, "illuminance" if not file else "")
        path = self.files.known(file, where, self.report, f"the picture {file!r}", "even light") if file else None
        if path is None:
            return lights.even_environment(strength)
        square = loading.read_image(path)
        if square.shape[0] != square.shape[1]:
            raise SceneError(f"{where}: filename: expected a square picture, of equal area, got {square.shape[:2]}")
        image = latitude_longitude(square)
        if light > 0.0:
            height = image.shape[0]
            polar = (np.arange(height) + 0.5) / height * np.pi
            weight = np.maximum(cos(polar), 0.0) * sin(polar) * 2.0 * np.pi**2 / (height * image.shape[1])
            total = float((product(image.astype(np.float64), PBRT_LUMINANCE) * weight[:, None]).sum())
            if total > 0.0:
                strength = rgb(np.array(strength) * light / total)
        return lights.environment_map(image, matrix, strength, path)
