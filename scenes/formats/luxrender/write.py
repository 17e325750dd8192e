"""Writer of LuxRender 1.x files, in the subset of the format that LuxCore 2.10 reads as well.

Source: LuxRender scene file format 1.0 (wiki of LuxRender); conventions measured with LuxCore 2.10; Hagemann 2018,
ch. 4.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from scenes.arithmetic import determinant, power, product
from scenes.canonical import (
    Camera,
    Cube,
    DirectionalLight,
    EnvironmentLight,
    Instance,
    Light,
    Medium,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
    SpotLight,
    SunSky,
)
from scenes.canonical.values import Matrix, Rgb
from scenes.daylight import sky_map
from scenes.formats.appearance.media import media_of
from scenes.formats.appearance.mixtures import direct_if_same, is_nothing
from scenes.formats.appearance.spot_profiles import reshaped
from scenes.formats.directives.scene_reader import FILTERS
from scenes.formats.directives.scene_writer import SceneWriter, quoted
from scenes.formats.geometry.conventions import FAR, MAP_AXES
from scenes.formats.geometry.meshed import as_mesh, of_radius_one
from scenes.formats.geometry.orientation import upright
from scenes.formats.geometry.placing import (
    borders_media,
    has_outside,
    lose_shine_behind,
    motion_keys,
    part_key,
    radiance_of,
    shines,
)
from scenes.formats.geometry.revolution import lamp_sphere
from scenes.formats.geometry.transform_stack import inverse
from scenes.formats.losses import LossReport, first_of
from scenes.formats.luxrender.media import SCHLICK
from scenes.formats.luxrender.read import SKY_UNIT, SPHERE_SR, SUN_UNIT, cone_sr
from scenes.formats.luxrender.write_materials import LuxSurfaceWriter
from scenes.formats.text.numbers import listed, number, written_matrix
from scenes.formats.text.output import Output

_FILTERS = first_of(FILTERS)
_SAMPLERS = {"sobol": "lowdiscrepancy", "halton": "lowdiscrepancy", "hammersley": "lowdiscrepancy",
             "stratified": "lowdiscrepancy", "independent": "random"}  # fmt: skip
_INTEGRATORS = {"path": "path", "whitted": "directlighting", "direct": "directlighting",
                "bidirectional": "bidirectional", "photonmap": "exphotonmap", "metropolis": "path"}  # fmt: skip


class LuxWriter(LuxSurfaceWriter, SceneWriter):
    """Collects the lines of a LuxRender scene."""

    _vacuum: str = ""
    _hole: str = ""

    def write_settings(self, scene: Scene) -> None:
        scene = direct_if_same(scene)
        integrator, sampler, film, depth = scene.integrator, scene.sampler, scene.film, self.depth(scene)
        kind = _INTEGRATORS[integrator.kind]
        if integrator.kind in ("whitted", "metropolis"):
            self.report.add("integrator", integrator.kind, kind, integrator.kind != "metropolis")
        elif integrator.kind == "direct" and depth <= 1:
            kind = "path"  # LuxCore has no other, and draws light of all paths for directlighting
        elif integrator.kind == "direct":
            self.report.add("integrator", "direct light and what mirrors show", "light of all paths in LuxCore")
        edges = depth + 1  # LuxCore counts edges of a path
        limit = f'"integer eyedepth" [ {edges} ] "integer lightdepth" [ {edges} ]'
        if kind != "bidirectional":
            limit = f'"integer maxdepth" [ {edges} ]'
        self.lines.append('Renderer "sampler"')
        self.lines.append(f'SurfaceIntegrator "{kind}" {limit}')
        if any(medium.scatters for medium in media_of(scene)):
            self.lines.append('VolumeIntegrator "multi"')
        if sampler.kind in ("halton", "hammersley", "stratified"):
            self.report.hint("sampler", sampler.kind, "lowdiscrepancy")
        count = sampler.samples_per_pixel
        self.lines.append(f'Sampler "{_SAMPLERS[sampler.kind]}" "integer pixelsamples" [ {count} ]')
        radius = number(film.filter_radius_px)
        width = f'"float xwidth" [ {radius} ] "float ywidth" [ {radius} ]'
        self.lines.append(f'PixelFilter "{_FILTERS[film.filter]}" {width}')
        size = f'"integer xresolution" [ {film.width_px} ] "integer yresolution" [ {film.height_px} ]'
        name = quoted((film.filename or "picture").rsplit(".", 1)[0])
        tone = (
            '"string tonemapkernel" [ "linear" ] "float linear_sensitivity" [ 100 ] "float linear_exposure" [ 1 ] '
            '"float linear_fstop" [ 2.8 ] "float linear_gamma" [ 1 ] "float gamma" [ 2.2 ]'
        )
        self.lines.append(f'Film "fleximage" {size} "string filename" [ {name} ] "integer haltspp" [ {count} ] {tone}')

    def write_camera(self, camera: Camera) -> None:
        """Writes the camera with ``LookAt``, the only placement that LuxCore supports; a window from right to left
        mirrors it."""
        poses, times_s = motion_keys(getattr(camera, "track", None), camera.to_world)
        size = power(abs(determinant(poses[0])), 1.0 / 3.0)
        axes = poses[0][:3, :3] / size
        if np.abs(product(axes.T, axes) - np.eye(3)).max() > 1e-4:
            self.report.add("camera", "a sheared camera", "an upright one")
        if isinstance(camera, PerspectiveCamera) and abs(size - 1.0) > 1e-6:
            lens, focus = size * camera.lens_radius, camera.focal_distance
            camera = dataclasses.replace(camera, lens_radius=lens, focal_distance=size * focus if focus != FAR else FAR)
        self.lines += _in_motion([_looking(pose) for pose in poses], times_s)
        half = camera.half_width if isinstance(camera, OrthographicCamera) else 1.0
        shift = camera.shift if isinstance(camera, PerspectiveCamera) else (0.0, 0.0)
        plain = camera
        if isinstance(camera, OrthographicCamera):
            plain = dataclasses.replace(camera, half_width=1.0)
        elif isinstance(camera, PerspectiveCamera):
            plain = dataclasses.replace(camera, shift=(0.0, 0.0))
        # without a window LuxCore applies the field of view to the width, not to the shorter side
        self.lines.append(self.camera_line(plain) + self.window(half, determinant(axes) < 0.0, shift))

    # --- lights --------------------------------------------------------------------------------------------------

    def write_light(self, light: Light) -> None:
        if isinstance(light, PointLight):
            shine = SPHERE_SR * np.array(light.intensity)
            line = f'"point" "point from" {listed(light.position)} "color L" {listed(shine)}'
        elif isinstance(light, SpotLight):
            light = reshaped(light, "secant", self.report)
            cone = f'"float coneangle" [ {number(light.outer_deg)} ]'
            cone += f' "float conedeltaangle" [ {number(light.outer_deg - light.inner_deg)} ]'
            ends = f'"point from" {listed(light.position)} "point to" {listed(light.target)}'
            line = f'"spot" {ends} "color L" {listed(light.intensity)} {cone}'
        elif isinstance(light, DirectionalLight):
            ends = f'"point from" {listed((0.0, 0.0, 0.0))} "point to" {listed(light.direction)}'
            theta = f' "float theta" [ {number(0.5 * light.angle_deg)} ]' if light.angle_deg else ""
            shine = np.array(light.irradiance) / (cone_sr(light.angle_deg) if light.angle_deg else 1.0)
            line = f'"distant" {ends} "color L" {listed(shine)}{theta}'
        elif isinstance(light, SunSky):
            self._daylight(light)
            return
        else:
            self._infinite(light)
            return
        self.lines.append(f'\tLightSource {line} "float gain" [ 1 ] "float power" [ 0 ] "float efficacy" [ 0 ]')

    def _daylight(self, light: SunSky) -> None:
        """Writes sun and sky. The zenith of LuxCore is z for any transform; a sky with another zenith becomes a map."""
        if light.part != "sky":
            self.report.add("light", "the colour of the sun", "that of LuxCore's model, bluer by up to 15 %")
            self._sun_or_sky("sun", light.sun_direction, light.turbidity, light.scale / SUN_UNIT)
        if light.part == "sun":
            return
        if light.up != (0.0, 0.0, 1.0):
            sky = sky_map(light)
            self.report.add("light", "a sky with its zenith not along z", f"a map of {sky.image.shape[0]} rows")
            self._infinite(sky)
            return
        if light.ground_albedo:
            self.report.add("light", f"a sky over ground of albedo {light.ground_albedo:g}", "over black ground")
        self._sun_or_sky("sky2", light.sun_direction, light.turbidity, light.scale / SKY_UNIT)

    def _sun_or_sky(self, kind: str, toward: Rgb, turbidity: float, gain: float) -> None:
        air = f'"float turbidity" [ {number(turbidity)} ] "float gain" [ {number(gain)} ]'
        self.lines.append(f'\tLightSource "{kind}" "vector sundir" {listed(toward)} {air}')

    def _infinite(self, light: EnvironmentLight) -> None:
        if light.image.shape[:2] == (1, 1):
            radiance = light.scale * light.image[0, 0].astype(np.float64)
            self.lines.append(f'\tLightSource "infinite" "color L" {listed(radiance)} "float gain" [ 1 ]')
            return
        file = self.output.picture(light.image, light.source, (".exr",))
        turn = product(light.to_world, inverse(MAP_AXES))
        self.lines += [
            "\tTransformBegin",
            f"\t\tTransform {written_matrix(turn)}",
            f'\t\tLightSource "infinite" "string mapname" [ "{file}" ] "string mapping" [ "latlong" ] '
            f'"float gamma" [ 1 ] "color L" [ 1 1 1 ] "float gain" [ {number(light.scale)} ]',
            "\tTransformEnd",
        ]

    # --- shapes --------------------------------------------------------------------------------------------------

    def write_instance(self, instance: Instance) -> None:
        """Writes a shape with its placement. LuxCore supports objects only for mesh files, and shows the last key of a
        motion."""
        instance = of_radius_one(instance)
        mirrored = determinant(instance.to_world) < 0.0
        if mirrored and (isinstance(instance.shape, Sphere) or has_outside(instance)):
            mesh, matrix = upright(self._meshed(instance), instance.to_world)
            instance = dataclasses.replace(instance, shape=mesh, to_world=matrix)
        made = [self.object_line(instance)] if part_key(instance) in self.shared else self.part(instance)
        poses, times_s = motion_keys(instance.track, instance.to_world)
        lines = [f"Transform {written_matrix(pose)}" for pose in poses]
        placing = [] if len(poses) == 1 and np.array_equal(poses[0], np.eye(4)) else _in_motion(lines, times_s)
        self.lines += ["\tAttributeBegin", *(f"\t\t{line}" for line in (*placing, *made)), "\tAttributeEnd"]

    def part(self, instance: Instance) -> list[str]:
        emission = radiance_of(instance)
        lose_shine_behind(instance, self.report)
        invisible = is_nothing(instance.material) and emission is None
        lines = [f'NamedMaterial "{self.material(self.nothing() if invisible else instance.material)}"']
        if borders_media(instance):
            if instance.exterior is None and self.medium not in (None, instance.interior):
                self.report.add(instance.name or "shape", "vacuum behind a medium within another", "the medium around")
            inside = self._hole if instance.interior is None else self.media[instance.interior]
            lines += [f'Interior "{inside}"', f'Exterior "{self._volume(instance.exterior)}"']
        if emission is not None:
            off = '"float gain" [ 1 ] "float power" [ 0 ] "float efficacy" [ 0 ]'
            lines.append(f'AreaLightSource "area" "color L" {listed(emission)} {off}')
        return [*lines, self._shape(instance)]

    def medium_line(self, medium: Medium, name: str) -> str:
        """The definition of a medium; LuxCore 2.10 reads volumes of the kind ``clear`` alone from these files."""
        if not medium.scatters:
            return f'MakeNamedVolume "{name}" "clear" "color absorption" {listed(medium.absorption)}'
        if medium.g:
            self.report.add(
                f"medium {name!r}", f"scattering by Henyey and Greenstein with a g of {medium.g:g}", SCHLICK
            )
        parts = f'"color sigma_a" {listed(medium.absorption)} "color sigma_s" {listed(medium.scattering)}'
        return f'MakeNamedVolume "{name}" "homogeneous" {parts} "color g" {listed((medium.g,) * 3)}'

    def around_camera(self) -> list[str]:
        """LuxCore has no unnamed vacuum, and takes an exterior outside of blocks for the medium around the camera.
        Behind a hole it goes on with the medium around only if the volume of the hole is outside of nothing."""
        self._vacuum, self._hole = self.label("vacuum", "vacuum"), self.label("hole", "hole")
        empty = '"clear" "color absorption" [ 0 0 0 ]'
        lines = [f'MakeNamedVolume "{name}" {empty}' for name in (self._vacuum, self._hole)]
        return [*lines, f'Exterior "{self.media[self.medium]}"'] if self.medium is not None else lines

    def _volume(self, medium: Medium | None) -> str:
        return self._vacuum if medium is None else self.media[medium]

    def _meshed(self, instance: Instance) -> Mesh:
        """A shape as triangles, because LuxCore ignores spheres and disks."""
        shape = instance.shape
        mesh = lamp_sphere() if isinstance(shape, Sphere) and shines(instance) else as_mesh(shape)
        if mesh is not shape and not isinstance(shape, Rectangle | Cube):
            what = f"shape {type(shape).__name__.lower()}"
            self.report.add(instance.name or "shape", what, f"a mesh of {len(mesh.faces)} triangles")
        return mesh

    def _shape(self, instance: Instance) -> str:
        mesh = self._meshed(instance)
        return self.mesh_line(mesh, in_file=part_key(instance) in self.shared)


def _looking(pose: Matrix) -> str:
    eye = pose[:3, 3]
    ends = [*eye, *(eye - pose[:3, 2]), *pose[:3, 1]]
    return "LookAt " + " ".join(repr(float(value)) for value in ends)


def _in_motion(lines: list[str], times_s: list[float]) -> list[str]:
    """Transforms as the keys of a motion; a single one is unchanged."""
    if len(lines) == 1:
        return lines
    return [f"MotionBegin [ {' '.join(repr(time_s) for time_s in times_s)} ]", *lines, "MotionEnd"]


def save_luxrender(scene: Scene, output: Output, report: LossReport) -> None:
    """Writes a scene and its files; they are not in place before the output is placed."""
    writer = LuxWriter(output, report)
    writer.write(scene)
    output.text(output.path.name, "\n".join(writer.lines) + "\n")
