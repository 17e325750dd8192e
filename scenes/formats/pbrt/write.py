"""Writer of PBRT v3 files.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenes.animation import pose_at
from scenes.arithmetic import product
from scenes.canonical import (
    Camera,
    ConstantTexture,
    Curves,
    DirectionalLight,
    Disk,
    EnvironmentLight,
    Instance,
    Light,
    Masked,
    Medium,
    PointLight,
    RigidTrack,
    Scene,
    Sphere,
    SpotLight,
    SunSky,
)
from scenes.canonical.values import Matrix
from scenes.daylight import sky_map, sun_light
from scenes.formats.appearance.media import media_of
from scenes.formats.appearance.mixtures import is_nothing
from scenes.formats.appearance.spot_profiles import reshaped
from scenes.formats.directives.scene_reader import FILTERS, FORWARD
from scenes.formats.directives.scene_writer import SceneWriter, quoted
from scenes.formats.geometry.conventions import MAP_AXES
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.geometry.placing import (
    borders_media,
    motion_keys,
    part_key,
    radiance_of,
    shines_behind,
    tracks_of,
)
from scenes.formats.geometry.transform_stack import inverse, track_times
from scenes.formats.losses import LossReport, first_of
from scenes.formats.pbrt.curves import curve_lines
from scenes.formats.pbrt.read import PbrtReader
from scenes.formats.pbrt.write_materials import PICTURES, PbrtSurfaceWriter
from scenes.formats.text.numbers import listed, number, written_matrix
from scenes.formats.text.output import Output

_FILTERS, _INTEGRATORS = first_of(FILTERS), first_of(PbrtReader.integrators)
_SAMPLERS = {**first_of(PbrtReader.samplers), "hammersley": "halton"}


@dataclass
class PbrtWriter(PbrtSurfaceWriter, SceneWriter):
    """Collects the lines of a PBRT scene.

    Attributes:
        times_s: the times of all motions, seconds.
    """

    times_s: tuple[float, float] = (0.0, 1.0)

    def write_times(self, scene: Scene) -> None:
        """Writes the two times that all motions of a PBRT file share."""
        tracks = tracks_of(scene)
        if tracks:
            times_s = [time_s for track in tracks for time_s in (track_times(track)[0], track_times(track)[-1])]
            self.times_s = min(times_s), max(times_s)
            self.lines.append(f"TransformTimes {self.times_s[0]!r} {self.times_s[1]!r}")

    # --- options -------------------------------------------------------------------------------------------------

    def write_settings(self, scene: Scene) -> None:
        self.write_times(scene)
        integrator, sampler, film, depth = scene.integrator, scene.sampler, scene.film, self.depth(scene)
        kind = _INTEGRATORS[integrator.kind]
        if media_of(scene) and kind not in PbrtReader.of_media:
            depth = min(depth, 1) if kind == "directlighting" else depth
            if kind == "whitted":
                self.report.add("integrator", "whitted", "volpath")
            kind = "volpath"
        self.lines.append(f'Integrator "{kind}" "integer maxdepth" [ {depth} ]')
        if sampler.kind == "stratified":
            self.lines.append(self.stratified_line(sampler.samples_per_pixel))
        else:
            count = sampler.samples_per_pixel
            self.lines.append(f'Sampler "{_SAMPLERS[sampler.kind]}" "integer pixelsamples" [ {count} ]')
            if sampler.kind == "hammersley":
                self.report.hint("sampler", "hammersley", "halton")
        radius = number(film.filter_radius_px)
        self.lines.append(
            f'PixelFilter "{_FILTERS[film.filter]}" "float xwidth" [ {radius} ] "float ywidth" [ {radius} ]'
        )
        name = quoted(film.filename or "picture.png")
        size = f'"integer xresolution" [ {film.width_px} ] "integer yresolution" [ {film.height_px} ]'
        self.lines.append(f'Film "image" {size} "string filename" [ {name} ]')

    def stratified_line(self, count: int) -> str:
        """A stratified sampler of ``count`` samples, as close to square as possible."""
        across = _most_even(count)
        return f'Sampler "stratified" "integer xsamples" [ {across} ] "integer ysamples" [ {count // across} ]'

    def write_camera(self, camera: Camera) -> None:
        track = getattr(camera, "track", None)
        keys = self.keys(track, camera.to_world, "camera")
        self.lines += self.moved([inverse(product(key, FORWARD)) for key in keys])
        self.lines.append(self.camera_line(camera))

    def keys(self, track: RigidTrack | None, to_world: Matrix, where: str) -> list[Matrix]:
        """Transforms at the two times of the file; a single one without motion."""
        poses, times_s = motion_keys(track, to_world)
        if track is None or len(poses) == 1:
            return poses
        if len(poses) > 2 or (times_s[0], times_s[-1]) != self.times_s:
            self.report.add(where, f"a motion of {len(poses)} keys", "from its first place to its last, evenly")
        return [product(pose_at(track, time_s), to_world) for time_s in self.times_s]

    def moved(self, keys: list[Matrix]) -> list[str]:
        """Lines that set the transform."""
        if len(keys) == 1:
            return [] if np.array_equal(keys[0], np.eye(4)) else [f"Transform {written_matrix(keys[0])}"]
        start, end = (f"Transform {written_matrix(key)}" for key in keys)
        return ["ActiveTransform StartTime", start, "ActiveTransform EndTime", end, "ActiveTransform All"]

    # --- lights --------------------------------------------------------------------------------------------------

    def write_light(self, light: Light) -> None:
        if isinstance(light, PointLight):
            self.lines.append(
                f'\tLightSource "point" "point from" {listed(light.position)} "rgb I" {listed(light.intensity)}'
            )
        elif isinstance(light, SpotLight):
            light = reshaped(light, "quartic", self.report)
            cone = f'"float coneangle" [ {number(light.outer_deg)} ]'
            cone += f' "float conedeltaangle" [ {number(light.outer_deg - light.inner_deg)} ]'
            ends = f'"point from" {listed(light.position)} "point to" {listed(light.target)}'
            self.lines.append(f'\tLightSource "spot" {ends} "rgb I" {listed(light.intensity)} {cone}')
        elif isinstance(light, DirectionalLight):
            if light.angle_deg:
                self.report.add("light", f"a sun of {light.angle_deg:g} degrees", "a parallel light")
            start = f'"point from" {listed((0.0, 0.0, 0.0))} "point to" {listed(light.direction)}'
            self.lines.append(f'\tLightSource "distant" {start} "rgb L" {listed(light.irradiance)}')
        elif isinstance(light, SunSky):
            self._daylight(light)
        else:
            self.infinite(light)

    def _daylight(self, light: SunSky) -> None:
        """Writes the sky as an image and the sun as a directional light."""
        if light.part != "sun":
            sky = sky_map(light)
            self.report.add("light", "the analytic sky", f"a map of {sky.image.shape[0]} rows")
            self.infinite(sky)
        if light.part != "sky":
            self.write_light(sun_light(light))

    def infinite(self, light: EnvironmentLight) -> None:
        if light.image.shape[:2] == (1, 1):
            radiance = light.scale * light.image[0, 0].astype(np.float64)
            self.lines.append(f'\tLightSource "infinite" "rgb L" {listed(radiance)}')
            return
        turn = product(light.to_world, inverse(MAP_AXES))
        self.lines += [
            "\tAttributeBegin",
            f"\t\tTransform {written_matrix(turn)}",
            f'\t\tLightSource "infinite" {self.map_of(light)}',
            "\tAttributeEnd",
        ]

    def map_of(self, light: EnvironmentLight) -> str:
        """The image of an environment light, and its factor."""
        file = self.output.picture(light.image, light.source, PICTURES)
        return f'"string mapname" [ "{file}" ] "rgb L" {listed((light.scale,) * 3)}'

    # --- shapes --------------------------------------------------------------------------------------------------

    def write_instance(self, instance: Instance) -> None:
        """Writes a shape, or a reference to an object, with its placement."""
        where = instance.name or "shape"
        made = self.part(instance) if part_key(instance) not in self.shared else [self.object_line(instance)]
        placing = self.moved(self.keys(instance.track, instance.to_world, where))
        self.lines += ["\tAttributeBegin", *(f"\t\t{line}" for line in (*placing, *made)), "\tAttributeEnd"]

    def part(self, instance: Instance) -> list[str]:
        """Lines of a shape and its material, without its placement."""
        material = instance.material
        emission = radiance_of(instance)
        if is_nothing(material) and emission is None:
            return [f'Material "{self.nothing}"', *self._sides(instance), *self._shapes(instance)]
        named = self.material(material.base if isinstance(material, Masked) else material)
        alpha = f" {self._alpha(material)}" if isinstance(material, Masked) else ""
        lines = [f'NamedMaterial "{named}"', *self._sides(instance)]
        if emission is not None:
            both = ' "bool twosided" [ "true" ]' if shines_behind(instance) else ""
            lines.append(f'AreaLightSource "diffuse" "rgb L" {listed(emission)}{both}')
        return [*lines, *(f"{line}{alpha}" for line in self._shapes(instance))]

    def medium_line(self, medium: Medium, name: str) -> str:
        parts = f'"rgb sigma_a" {listed(medium.absorption)} "rgb sigma_s" {listed(medium.scattering)}'
        g = f' "float g" [ {number(medium.g)} ]' if medium.g else ""
        return f'MakeNamedMedium "{name}" "string type" [ "homogeneous" ] {parts}{g}'

    def around_camera(self) -> list[str]:
        return [self._interface(None, self.medium)] if self.medium is not None else []

    def _sides(self, instance: Instance) -> list[str]:
        """The line of the media of both sides; all shapes need one if the camera is in a medium."""
        needed = self.medium is not None or borders_media(instance)
        return [self._interface(instance.interior, instance.exterior)] if needed else []

    def _interface(self, inside: Medium | None, outside: Medium | None) -> str:
        names = ("" if medium is None else self.media[medium] for medium in (inside, outside))
        return "MediumInterface " + " ".join(f'"{name}"' for name in names)

    def _alpha(self, material: Masked) -> str:
        opacity = material.opacity
        if isinstance(opacity, ConstantTexture):
            if len(set(opacity.value)) > 1:
                self.report.add("shape", "an opacity for each colour", "by their mean")
            return f'"float alpha" [ {number(float(np.mean(opacity.value)))} ]'
        return self.texture(opacity, "alpha", "float")

    def _shapes(self, instance: Instance) -> list[str]:
        if isinstance(instance.shape, Curves):
            return list(curve_lines(instance.shape, self.report, instance.name or "shape"))
        return [self._shape(instance)]

    def _shape(self, instance: Instance) -> str:
        shape = instance.shape
        if isinstance(shape, Sphere):
            return f'Shape "sphere" "float radius" [ {number(shape.radius)} ]'
        if isinstance(shape, Disk):
            return f'Shape "disk" "float radius" [ {number(shape.radius)} ]'
        return self.mesh_line(as_mesh(shape))


def _most_even(count: int) -> int:
    """The least divisor of a number that is at least its square root."""
    return next(
        size for size in range(max(1, math.isqrt(count - 1) + 1 if count > 1 else 1), count + 1) if count % size == 0
    )


def save_pbrt(scene: Scene, output: Output, report: LossReport) -> None:
    """Writes a scene and its files; they are not in place before the output is placed."""
    writer = PbrtWriter(output, report)
    writer.write(scene)
    output.text(output.path.name, "\n".join(writer.lines) + "\n")
