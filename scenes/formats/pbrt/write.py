"""The canonical scene as a PBRT v3 file.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from scenes.animation import pose_at
from scenes.arithmetic import product
from scenes.canonical import (
    Camera,
    ConstantTexture,
    DirectionalLight,
    Disk,
    EnvironmentCamera,
    EnvironmentLight,
    Film,
    Instance,
    Light,
    Masked,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    RealisticCamera,
    RigidTrack,
    Scene,
    Sphere,
    SpotLight,
    SunSky,
)
from scenes.canonical.values import Matrix
from scenes.daylight import sky_map, sun_light
from scenes.formats.appearance.spot_profiles import reshaped
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.geometry.placing import PartKey, motion_keys, part_key, radiance_of, shared_parts, tracks_of
from scenes.formats.geometry.transform_stack import inverse, track_times
from scenes.formats.losses import LossReport, first_of
from scenes.formats.pbrt.read import FAR, FILTERS, FORWARD, INTEGRATORS, MAP_AXES, SAMPLERS
from scenes.formats.pbrt.write_materials import PICTURES, PbrtSurfaceWriter, listed, number
from scenes.formats.text.output import Output

INLINE_MAX = 64
"""Triangles of a mesh that is written into the scene file; larger ones get a file of their own."""

_FILTERS, _INTEGRATORS = first_of(FILTERS), first_of(INTEGRATORS)
_SAMPLERS = {**first_of(SAMPLERS), "hammersley": "halton"}


def written_matrix(matrix: Matrix) -> str:
    """Sixteen numbers, column by column, with all digits."""
    return f"[ {' '.join(repr(float(value)) for value in matrix.T.ravel())} ]"


@dataclass
class PbrtWriter(PbrtSurfaceWriter):
    """Lines of a scene, as they are made."""

    aspect: tuple[float, float] = (1.0, 1.0)
    times_s: tuple[float, float] = (0.0, 1.0)
    shared: frozenset[PartKey] = frozenset()
    _objects: dict[PartKey, str] = field(default_factory=dict)

    def write(self, scene: Scene) -> None:
        """Writes a scene."""
        self.shared = shared_parts(scene)
        self._times(scene)
        self._options(scene)
        self._camera(scene.camera)
        self.lines.append("WorldBegin")
        self._environment_only_seen(scene)
        for name, material in scene.materials.items():
            self.material(material, name)
        for light in scene.lights:
            self._light(light)
        for instance in scene.instances:
            self._instance(instance)
        self.lines.append("WorldEnd")

    def _environment_only_seen(self, scene: Scene) -> None:
        if scene.background is not None:
            self.report.add(scene.name or "scene", "a background that is seen and does not light", "an infinite light")
            self._light(scene.background)
        if scene.ambient != (0.0, 0.0, 0.0):
            self.report.add(scene.name or "scene", "constant ambient light")

    def _times(self, scene: Scene) -> None:
        """All motions share the two times of a PBRT file."""
        tracks = tracks_of(scene)
        if tracks:
            times_s = [time_s for track in tracks for time_s in (track_times(track)[0], track_times(track)[-1])]
            self.times_s = min(times_s), max(times_s)
            self.lines.append(f"TransformTimes {self.times_s[0]!r} {self.times_s[1]!r}")

    # --- options -------------------------------------------------------------------------------------------------

    def _options(self, scene: Scene) -> None:
        self.aspect = aspect_of(scene.film)
        integrator, sampler, film = scene.integrator, scene.sampler, scene.film
        depth = integrator.depth
        if depth < 0:
            depth = 1000
            self.report.add("integrator", "paths without a limit", "1000 bounces")
        self.lines.append(f'Integrator "{_INTEGRATORS[integrator.kind]}" "integer maxdepth" [ {depth} ]')
        if sampler.kind == "stratified":
            across = _most_even(sampler.samples_per_pixel)
            sizes = across, sampler.samples_per_pixel // across
            self.lines.append(
                f'Sampler "stratified" "integer xsamples" [ {sizes[0]} ] "integer ysamples" [ {sizes[1]} ]'
            )
        else:
            count = sampler.samples_per_pixel
            self.lines.append(f'Sampler "{_SAMPLERS[sampler.kind]}" "integer pixelsamples" [ {count} ]')
            if sampler.kind == "hammersley":
                self.report.add("sampler", "hammersley", "halton")
        radius = number(film.filter_radius_px)
        self.lines.append(
            f'PixelFilter "{_FILTERS[film.filter]}" "float xwidth" [ {radius} ] "float ywidth" [ {radius} ]'
        )
        name = _quoted(film.filename or "picture.png")
        size = f'"integer xresolution" [ {film.width_px} ] "integer yresolution" [ {film.height_px} ]'
        self.lines.append(f'Film "image" {size} "string filename" [ {name} ]')

    def _camera(self, camera: Camera) -> None:
        track = getattr(camera, "track", None)
        keys = self.keys(track, camera.to_world, "camera")
        self.lines += self.moved([inverse(product(key, FORWARD)) for key in keys])
        self.lines.append(self._camera_line(camera))

    def keys(self, track: RigidTrack | None, to_world: Matrix, where: str) -> list[Matrix]:
        """Where something is at the two times of the file; one matrix where it rests."""
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

    def window(self, half: float, mirrored: bool = False) -> str:
        """The screen window of an image whose shorter side is twice ``half``."""
        width, height = (half * side for side in self.aspect)
        left = width if mirrored else -width
        return f' "float screenwindow" {listed((left, -left, -height, height))}'

    def _camera_line(self, camera: Camera) -> str:
        """What a camera is, without its place."""
        if isinstance(camera, PerspectiveCamera):
            line = f'Camera "perspective" "float fov" [ {number(camera.fov_deg)} ]'
            if camera.lens_radius > 0.0:
                line += f' "float lensradius" [ {number(camera.lens_radius)} ]'
            if camera.focal_distance != FAR:
                line += f' "float focaldistance" [ {number(camera.focal_distance)} ]'
            if camera.shutter_s != (0.0, 0.0):
                line += f' "float shutteropen" [ {number(camera.shutter_s[0])} ]'
                line += f' "float shutterclose" [ {number(camera.shutter_s[1])} ]'
        elif isinstance(camera, OrthographicCamera):
            line = 'Camera "orthographic"'
            if camera.half_width != 1.0:
                line += self.window(camera.half_width)
        elif isinstance(camera, EnvironmentCamera):
            line = 'Camera "environment"'
        else:
            assert isinstance(camera, RealisticCamera)
            numbers = (
                f'"float aperturediameter" [ {number(camera.aperture_diameter)} ] '
                f'"float focusdistance" [ {number(camera.focus_distance)} ]'
            )
            line = f'Camera "realistic" "string lensfile" [ {_quoted(camera.lens_file)} ] {numbers}'
        return line

    # --- lights --------------------------------------------------------------------------------------------------

    def _light(self, light: Light) -> None:
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
            self._infinite(light)

    def _daylight(self, light: SunSky) -> None:
        """The sky as a picture, the sun as a light from one direction."""
        if light.part != "sun":
            sky = sky_map(light)
            self.report.add("light", "the analytic sky", f"a map of {sky.image.shape[0]} rows")
            self._infinite(sky)
        if light.part != "sky":
            self._light(sun_light(light))

    def _infinite(self, light: EnvironmentLight) -> None:
        if light.image.shape[:2] == (1, 1):
            radiance = light.scale * light.image[0, 0].astype(np.float64)
            self.lines.append(f'\tLightSource "infinite" "rgb L" {listed(radiance)}')
            return
        file = self.output.picture(light.image, light.source, PICTURES)
        turn = product(light.to_world, inverse(MAP_AXES))
        self.lines += [
            "\tAttributeBegin",
            f"\t\tTransform {written_matrix(turn)}",
            f'\t\tLightSource "infinite" "string mapname" [ "{file}" ] "rgb L" {listed((light.scale,) * 3)}',
            "\tAttributeEnd",
        ]

    # --- shapes --------------------------------------------------------------------------------------------------

    def _instance(self, instance: Instance) -> None:
        """A shape, or an object that was made before, in its place."""
        where = instance.name or "shape"
        made = self._part(instance) if part_key(instance) not in self.shared else [self._object(instance)]
        placing = self.moved(self.keys(instance.track, instance.to_world, where))
        self.lines += ["\tAttributeBegin", *(f"\t\t{line}" for line in (*placing, *made)), "\tAttributeEnd"]

    def _object(self, instance: Instance) -> str:
        """The line that places an object; the object is made where it is new."""
        key = part_key(instance)
        if key not in self._objects:
            made = self._part(instance)
            label = self._label("o", "")
            self._objects[key] = label
            self.lines += [f'\tObjectBegin "{label}"', *(f"\t\t{line}" for line in made), "\tObjectEnd"]
        return f'ObjectInstance "{self._objects[key]}"'

    def _part(self, instance: Instance) -> list[str]:
        """Lines of a shape and what it is made of, without its place."""
        material = instance.material
        emission = radiance_of(instance, self.report)
        named = self.material(material.base if isinstance(material, Masked) else material)
        alpha = f" {self._alpha(material)}" if isinstance(material, Masked) else ""
        lines = [f'NamedMaterial "{named}"']
        if emission is not None:
            lines.append(f'AreaLightSource "diffuse" "rgb L" {listed(emission)}')
        return [*lines, f"{self._shape(instance)}{alpha}"]

    def _alpha(self, material: Masked) -> str:
        opacity = material.opacity
        if isinstance(opacity, ConstantTexture):
            return f'"float alpha" [ {number(float(np.mean(opacity.value)))} ]'
        return self.texture(opacity, "alpha", "float")

    def _shape(self, instance: Instance) -> str:
        shape = instance.shape
        if isinstance(shape, Sphere):
            return f'Shape "sphere" "float radius" [ {number(shape.radius)} ]'
        if isinstance(shape, Disk):
            return f'Shape "disk" "float radius" [ {number(shape.radius)} ]'
        mesh = as_mesh(shape)
        if len(mesh.faces) > INLINE_MAX:
            return f'Shape "plymesh" "string filename" [ "{self.output.mesh(mesh)}" ]'
        return f'Shape "trianglemesh" {inline_mesh(mesh, "uv")}'


def inline_mesh(mesh: Mesh, uv: str) -> str:
    """Parameters of a mesh."""
    parts = [f'"integer indices" [ {" ".join(map(str, mesh.faces.ravel().tolist()))} ]']
    parts.append(f'"point P" {listed(mesh.vertices.ravel())}')
    if mesh.normals is not None:
        parts.append(f'"normal N" {listed(mesh.normals.ravel())}')
    if mesh.uvs is not None:
        parts.append(f'"float {uv}" {listed(mesh.uvs.ravel())}')
    return " ".join(parts)


def aspect_of(film: Film) -> tuple[float, float]:
    """Width and height of a film in units of its shorter side."""
    shorter = min(film.width_px, film.height_px)
    return film.width_px / shorter, film.height_px / shorter


def _most_even(count: int) -> int:
    """The divisor of a number nearest to its root, from above."""
    return next(
        size for size in range(max(1, math.isqrt(count - 1) + 1 if count > 1 else 1), count + 1) if count % size == 0
    )


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "/").replace('"', "") + '"'


def save_pbrt(scene: Scene, output: Output, report: LossReport) -> None:
    """Writes a scene and what belongs to it; nothing is in place until the output is."""
    writer = PbrtWriter(output, report)
    writer.write(scene)
    output.text(output.path.name, "\n".join(writer.lines) + "\n")
