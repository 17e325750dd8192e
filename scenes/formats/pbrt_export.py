"""The canonical scene as a PBRT v3 file.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from scenes.animation import pose_at
from scenes.canonical import (
    Bumped,
    Camera,
    CheckerboardTexture,
    ConstantTexture,
    DirectionalLight,
    Disk,
    Emissive,
    EnvironmentCamera,
    EnvironmentLight,
    Film,
    Glass,
    Glossy,
    HeightField,
    ImageTexture,
    Instance,
    Light,
    Masked,
    Material,
    Matte,
    Mesh,
    Metal,
    Mirror,
    MixMaterial,
    MixTexture,
    OrthographicCamera,
    PerspectiveCamera,
    Phong,
    Plastic,
    PointLight,
    RealisticCamera,
    Rgb,
    RigidTrack,
    ScaleTexture,
    Scene,
    Sphere,
    SpotLight,
    SunSky,
    Texture,
    Translucent,
    Uber,
)
from scenes.daylight import sky_map, sun_light
from scenes.formats.losses import LossReport, first_of
from scenes.formats.output import Output
from scenes.formats.pbrt import FAR, FILTERS, FORWARD, INTEGRATORS, MAP_AXES, SAMPLERS
from scenes.formats.pbrt_surfaces import mean_of
from scenes.formats.recognition import as_mesh
from scenes.formats.spectra import rgb
from scenes.formats.transform_stack import inverse
from scenes.values import Matrix

INLINE_MAX = 64
"""Triangles of a mesh that is written into the scene file; larger ones get a file of their own."""

_FILTERS, _INTEGRATORS = first_of(FILTERS), first_of(INTEGRATORS)
_SAMPLERS = {**first_of(SAMPLERS), "hammersley": "halton"}


def number(value: float) -> str:
    """A number with what float32 holds, and more where it is needed."""
    return f"{float(value):.9g}"


def listed(values: Iterable[float]) -> str:
    """Numbers in brackets."""
    return f"[ {' '.join(number(value) for value in values)} ]"


def written_matrix(matrix: Matrix) -> str:
    """Sixteen numbers, column by column, with all digits."""
    return f"[ {' '.join(repr(float(value)) for value in matrix.T.ravel())} ]"


@dataclass
class PbrtWriter:
    """Lines of a scene, as they are made."""

    output: Output
    report: LossReport
    lines: list[str] = field(default_factory=list)
    aspect: tuple[float, float] = (1.0, 1.0)
    _textures: dict[int, tuple[Texture, str]] = field(default_factory=dict)
    _materials: dict[int, tuple[Material, str]] = field(default_factory=dict)
    _taken: set[str] = field(default_factory=set)

    def write(self, scene: Scene) -> None:
        """Writes a scene."""
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
        if scene.duration_s:
            self.report.add(scene.name or "scene", "an animation over many frames", "its first frame")

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
        if track is not None:
            self.report.add("camera", "the motion of the camera", "its place at the start")
        self.lines.append(f"Transform {written_matrix(inverse(placed(track, camera.to_world) @ FORWARD))}")
        self.lines.append(self._camera_line(camera))

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

    # --- textures and materials ----------------------------------------------------------------------------------

    def texture(self, texture: Texture, name: str) -> str:
        """A parameter of a material or texture, its texture written before."""
        if isinstance(texture, ConstantTexture):
            return f'"rgb {name}" {listed(texture.value)}'
        if id(texture) not in self._textures:
            made = self._texture_line(texture)
            label = self._label("t", "")
            self._textures[id(texture)] = texture, label
            self.lines.append(f'\tTexture "{label}" "spectrum" {made}')
        return f'"texture {name}" [ "{self._textures[id(texture)][1]}" ]'

    def _texture_line(self, texture: Texture) -> str:
        if isinstance(texture, ImageTexture):
            file = self.output.picture(texture.image, texture.source)
            scale, offset = texture.uv_scale, texture.uv_offset
            if texture.filter != "mipmap":
                self.report.add(f"texture {file}", f"the filter {texture.filter}", "levels of detail")
            return (
                f'"imagemap" "string filename" [ "{file}" ] "string wrap" [ "{texture.wrap}" ] '
                f'"float uscale" [ {number(scale[0])} ] "float vscale" [ {number(scale[1])} ] '
                f'"float udelta" [ {number(offset[0])} ] "float vdelta" [ {number(offset[1])} ]'
            )
        if isinstance(texture, CheckerboardTexture):
            parts = f"{self.texture(texture.even, 'tex1')} {self.texture(texture.odd, 'tex2')}"
            scale = texture.uv_scale
            return f'"checkerboard" {parts} "float uscale" [ {number(scale[0])} ] "float vscale" [ {number(scale[1])} ]'
        assert isinstance(texture, MixTexture | ScaleTexture)
        parts = f"{self.texture(texture.first, 'tex1')} {self.texture(texture.second, 'tex2')}"
        if isinstance(texture, MixTexture):
            return f'"mix" {parts} "float amount" [ {number(texture.amount)} ]'
        return f'"scale" {parts}'

    def _label(self, prefix: str, wanted: str) -> str:
        """A name that nothing has yet."""
        label, count = wanted or f"{prefix}1", 1
        while label in self._taken or '"' in label or "\\" in label or "\n" in label:
            count += 1
            label = f"{prefix}{count}"
        self._taken.add(label)
        return label

    def material(self, material: Material, name: str = "") -> str:
        """Name of a material, written before where it is new."""
        if id(material) not in self._materials:
            made = self._material_line(material, name or type(material).__name__)
            label = self._label("m", name)
            self._materials[id(material)] = material, label
            self.lines.append(f'\tMakeNamedMaterial "{label}" {made}')
        return self._materials[id(material)][1]

    def _material_line(self, material: Material, name: str) -> str:
        where = f"material {name!r}"
        if isinstance(material, Bumped):
            if material.scale != 1.0:
                self.report.add(where, "the scale of a bump map", "1")
            bump = self.texture(material.height, "bumpmap")
            return f"{self._material_line(material.base, name)} {bump}"
        if isinstance(material, Masked):
            self.report.add(where, "holes in a material", "those of the shapes that have it")
            return self._material_line(material.base, name)
        if isinstance(material, HeightField):
            self.report.add(where, "a height field", "its material, flat")
            return self._material_line(material.base, name)
        if isinstance(material, MixMaterial):
            parts = f'"string namedmaterial1" [ "{self.material(material.second)}" ]'
            parts += f' "string namedmaterial2" [ "{self.material(material.first)}" ]'
            return f'"string type" [ "mix" ] {parts} {self.texture(material.amount, "amount")}'
        kind, parameters = self._plain_material(material, where)
        return f'"string type" [ "{kind}" ] {" ".join(parameters)}'

    def _plain_material(self, material: Material, where: str) -> tuple[str, list[str]]:
        if isinstance(material, Matte):
            sigma = [f'"float sigma" [ {number(material.sigma_deg)} ]'] if material.sigma_deg else []
            return "matte", [self.texture(material.reflectance, "Kd"), *sigma]
        if isinstance(material, Mirror):
            if material.spread_deg:
                self.report.add(where, "rays spread about the mirrored one", "a sharp mirror")
            return "mirror", [self.texture(material.reflectance, "Kr")]
        if isinstance(material, Glass):
            if material.thin:
                self.report.add(where, "a pane without thickness", "clear glass")
            if material.spread_deg:
                self.report.add(where, "rays spread about the perfect ones", "clear glass")
            parts = [self.texture(material.reflectance, "Kr"), self.texture(material.transmittance, "Kt")]
            parts.append(f'"float eta" [ {number(material.ior)} ]')
            return "glass", parts + (_roughness(material.roughness) if material.roughness != (0.0, 0.0) else [])
        if isinstance(material, Metal):
            if mean_of(material.reflectance_scale) != (1.0, 1.0, 1.0):
                self.report.add(where, "a factor on what metal reflects", "1")
            if material.distribution != "ggx":
                self.report.add(where, f"the distribution {material.distribution} of facets", "Trowbridge–Reitz (ggx)")
            index = [f'"rgb eta" {listed(material.eta)}', f'"rgb k" {listed(material.k)}']
            return "metal", index + _roughness(material.roughness)
        if isinstance(material, Glossy):
            parts = [self.texture(material.diffuse, "Kd"), self.texture(material.specular, "Ks")]
            return "substrate", parts + _roughness(material.roughness)
        if isinstance(material, Plastic):
            if material.ior != 1.5:
                self.report.add(where, f"the index {material.ior:g} of a plastic", "1.5")
            parts = [self.texture(material.diffuse, "Kd"), self.texture(material.specular, "Ks")]
            rough = f'"float roughness" [ {number(material.roughness)} ] "bool remaproughness" [ "false" ]'
            return "plastic", [*parts, rough]
        if isinstance(material, Translucent):
            white, black = f'"rgb Kd" {listed((1.0, 1.0, 1.0))}', f'"rgb Ks" {listed((0.0, 0.0, 0.0))}'
            sides = [self.texture(material.reflectance, "reflect"), self.texture(material.transmittance, "transmit")]
            return "translucent", [white, black, *sides]
        if isinstance(material, Uber):
            names = ("diffuse", "Kd"), ("specular", "Ks"), ("reflectance", "Kr"), ("transmittance", "Kt")
            parts = [self.texture(getattr(material, ours), theirs) for ours, theirs in names]
            parts += [self.texture(material.opacity, "opacity"), f'"float eta" [ {number(material.ior)} ]']
            return "uber", parts + _roughness(material.roughness)
        if isinstance(material, Phong):
            return self._phong(material, where)
        assert isinstance(material, Emissive)
        return "matte", [f'"rgb Kd" {listed((0.0, 0.0, 0.0))}']

    def _phong(self, material: Phong, where: str) -> tuple[str, list[str]]:
        """Highlights as wide: alpha² = 2 / (exponent + 2) (Walter et al. 2007, sec. 5.2)."""
        alpha = math.sqrt(2.0 / (material.exponent + 2.0))
        became = f"uber with a highlight of alpha {alpha:.3g}"
        self.report.add(where, "Phong reflection with a Fresnel-weighted mirror", became)
        black = listed((0.0, 0.0, 0.0))
        parts = [self.texture(material.diffuse, "Kd"), f'"rgb Ks" {listed(material.specular)}']
        mirrored = rgb(material.fresnel_min * np.array(material.mirror_tint))
        return "uber", [*parts, f'"rgb Kr" {listed(mirrored)}', f'"rgb Kt" {black}', *_roughness((alpha, alpha))]

    # --- lights --------------------------------------------------------------------------------------------------

    def _light(self, light: Light) -> None:
        if isinstance(light, PointLight):
            self.lines.append(
                f'\tLightSource "point" "point from" {listed(light.position)} "rgb I" {listed(light.intensity)}'
            )
        elif isinstance(light, SpotLight):
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
        file = self.output.picture(light.image, light.source)
        turn = light.to_world @ inverse(MAP_AXES)
        self.lines += [
            "\tAttributeBegin",
            f"\t\tTransform {written_matrix(turn)}",
            f'\t\tLightSource "infinite" "string mapname" [ "{file}" ] "rgb L" {listed((light.scale,) * 3)}',
            "\tAttributeEnd",
        ]

    # --- shapes --------------------------------------------------------------------------------------------------

    def _instance(self, instance: Instance) -> None:
        material = instance.material
        lines = ["\tAttributeBegin"]
        if isinstance(material, Emissive):
            self.report.add(instance.name or "shape", "a surface that shines on both sides", "on its front")
        emission: Rgb | None = material.radiance if isinstance(material, Emissive) else instance.emission
        named = self.material(material.base if isinstance(material, Masked) else material)
        alpha = f" {self._alpha(material)}" if isinstance(material, Masked) else ""
        if emission is not None:
            lines.append(f'\t\tAreaLightSource "diffuse" "rgb L" {listed(emission)}')
        lines.append(f'\t\tNamedMaterial "{named}"')
        if instance.track is not None:
            self.report.add(instance.name or "shape", "the motion of a shape", "its place at the start")
        to_world = placed(instance.track, instance.to_world)
        if not np.array_equal(to_world, np.eye(4)):
            lines.append(f"\t\tTransform {written_matrix(to_world)}")
        lines += [f"\t\t{self._shape(instance)}{alpha}", "\tAttributeEnd"]
        self.lines += lines

    def _alpha(self, material: Masked) -> str:
        opacity = material.opacity
        if isinstance(opacity, ConstantTexture):
            return f'"float alpha" [ {number(float(np.mean(opacity.value)))} ]'
        return self.texture(opacity, "alpha")

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


def placed(track: RigidTrack | None, to_world: Matrix) -> Matrix:
    """Where something is at the first key of its motion."""
    if track is None:
        return to_world
    return pose_at(track, track.start_s) @ to_world


def _roughness(alphas: tuple[float, float]) -> list[str]:
    pair = f'"float uroughness" [ {number(alphas[0])} ] "float vroughness" [ {number(alphas[1])} ]'
    return [f'{pair} "bool remaproughness" [ "false" ]']


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
