"""Writer of PBRT v4 files.

Source: PBRT v4 file format (https://www.pbrt.org/fileformat-v4).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from scenes import loading
from scenes.canonical import Camera, EnvironmentLight, Light, PerspectiveCamera, Scene, SpotLight
from scenes.formats.appearance.equal_area import equal_area, latitude_longitude
from scenes.formats.appearance.mixtures import direct_if_same
from scenes.formats.appearance.spot_profiles import reshaped
from scenes.formats.directives.scene_writer import quoted
from scenes.formats.losses import LossReport
from scenes.formats.pbrt.v4_write_materials import V4_PICTURES, PbrtV4SurfaceWriter
from scenes.formats.pbrt.write import PbrtWriter
from scenes.formats.text.numbers import listed, number
from scenes.formats.text.output import Output

_TYPES = {'"point P"': '"point3 P"', '"point from"': '"point3 from"', '"point to"': '"point3 to"',
          '"float uv"': '"point2 uv"', '[ "false" ]': "[ false ]", '[ "true" ]': "[ true ]"}  # fmt: skip
"""Declarations of version 3, and their types in version 4."""

_SAMPLERS = {"sobol": "zsobol", "halton": "halton", "hammersley": "halton", "independent": "independent",
             "stratified": "stratified"}  # fmt: skip
_INTEGRATORS = {"path": "volpath", "bidirectional": "bdpt", "metropolis": "mlt", "photonmap": "sppm"}
_FILTERS = {"box": "box", "tent": "triangle", "gaussian": "gaussian", "mitchell": "mitchell", "sinc": "sinc"}


@dataclass
class PbrtV4Writer(PbrtV4SurfaceWriter, PbrtWriter):
    """Collects the lines of a PBRT v4 scene."""

    nothing: ClassVar[str] = "interface"

    def write(self, scene: Scene) -> None:
        super().write(scene)
        assert self.lines.pop() == "WorldEnd"

    def write_settings(self, scene: Scene) -> None:
        scene = direct_if_same(scene)
        self.write_times(scene)
        integrator, sampler, film, depth = scene.integrator, scene.sampler, scene.film, self.depth(scene)
        kind = _INTEGRATORS.get(integrator.kind, "volpath")
        if integrator.kind == "direct":
            depth = min(depth, 1)
        elif integrator.kind == "whitted":
            self.report.add("integrator", "whitted", "volpath")
        self.lines.append(f'Integrator "{kind}" "integer maxdepth" [ {depth} ]')
        if sampler.kind == "stratified":
            self.lines.append(self.stratified_line(sampler.samples_per_pixel))
        else:
            count = f'"integer pixelsamples" [ {sampler.samples_per_pixel} ]'
            self.lines.append(f'Sampler "{_SAMPLERS[sampler.kind]}" {count}')
            if sampler.kind == "hammersley":
                self.report.hint("sampler", "hammersley", "halton")
        radius = number(film.filter_radius_px)
        widths = f'"float xradius" [ {radius} ] "float yradius" [ {radius} ]'
        self.lines.append(f'PixelFilter "{_FILTERS[film.filter]}" {widths}')
        size = f'"integer xresolution" [ {film.width_px} ] "integer yresolution" [ {film.height_px} ]'
        iso = f' "float iso" [ {number(100.0 / _exposed_s(scene.camera))} ]' if _exposed_s(scene.camera) != 1.0 else ""
        self.lines.append(f'Film "rgb" {size} "string filename" [ {quoted(film.filename or "picture.png")} ]{iso}')

    # --- lights --------------------------------------------------------------------------------------------------

    def write_light(self, light: Light) -> None:
        if not isinstance(light, SpotLight):
            super().write_light(light)
            return
        light = reshaped(light, "hermite", self.report)
        cone = f'"float coneangle" [ {number(light.outer_deg)} ]'
        cone += f' "float conedeltaangle" [ {number(light.outer_deg - light.inner_deg)} ]'
        ends = f'"point3 from" {listed(light.position)} "point3 to" {listed(light.target)}'
        self.lines.append(f'\tLightSource "spot" {ends} "rgb I" {listed(light.intensity)} {cone}')

    def map_of(self, light: EnvironmentLight) -> str:
        square, source = _square_of(light)
        if not source:
            self.report.add("light", "a latitude–longitude environment map", "one of equal area, resampled")
        file = self.output.picture(square, source, V4_PICTURES)
        return f'"string filename" [ "{file}" ] "float scale" [ {number(light.scale)} ]'


def _square_of(light: EnvironmentLight) -> tuple[np.ndarray, str]:
    """The equal-area map of a light: the square file from which it was read, or a resampled one."""
    if light.source and Path(light.source).is_file():
        found = loading.read_image(Path(light.source))
        if found.shape[0] == found.shape[1] and np.array_equal(latitude_longitude(found), light.image):
            return found, light.source
    return equal_area(light.image), ""


def _exposed_s(camera: Camera) -> float:
    """Exposure time by the rule of PBRT v4, seconds: 1 if no shutter times are given, or they are equal."""
    times = camera.shutter_s if isinstance(camera, PerspectiveCamera) else (0.0, 0.0)
    return times[1] - times[0] if times[1] > times[0] else 1.0


def save_pbrt4(scene: Scene, output: Output, report: LossReport) -> None:
    """Writes a scene and its files; they are not in place before the output is placed."""
    writer = PbrtV4Writer(output, report)
    writer.write(scene)
    text = "\n".join(writer.lines) + "\n"
    for old, new in _TYPES.items():
        text = text.replace(old, new)
    output.text(output.path.name, text)
