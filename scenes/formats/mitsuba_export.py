"""The canonical scene as a Mitsuba 0.5 file, or in the names and plugins of Mitsuba 3.

Source: Mitsuba 0.5 documentation; Mitsuba 3 documentation, plugin reference; Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import dataclasses
import math
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field

import numpy as np

from scenes.canonical import (
    Bumped,
    Camera,
    CheckerboardTexture,
    ConstantTexture,
    Cube,
    DirectionalLight,
    Disk,
    Emissive,
    EnvironmentCamera,
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
    OrthographicCamera,
    PerspectiveCamera,
    Phong,
    Plastic,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
    SpotLight,
    SunSky,
    Texture,
    Translucent,
    Uber,
)
from scenes.daylight import facing_up
from scenes.formats.losses import LossReport, first_of
from scenes.formats.mitsuba import FAR, FILTERS, FORWARD
from scenes.formats.output import Output
from scenes.formats.pbrt_export import number, placed
from scenes.formats.pbrt_surfaces import mean_of
from scenes.formats.spectra import grey, rgb
from scenes.values import Matrix, Rgb

Element = ElementTree.Element

_FILTERS = first_of(FILTERS)
_SAMPLERS = {"independent": "independent", "stratified": "stratified", "sobol": "sobol", "halton": "halton",
             "hammersley": "hammersley"}  # fmt: skip
_INTEGRATORS = {"path": "path", "direct": "direct", "whitted": "direct", "bidirectional": "bdpt",
                "photonmap": "photonmapper", "metropolis": "pssmlt"}  # fmt: skip
_NEW_NAMES = {"toWorld": "to_world", "intIOR": "int_ior", "extIOR": "ext_ior"}


@dataclass
class MitsubaWriter:
    """Elements of a scene, as they are made; ``modern`` is Mitsuba 3."""

    output: Output
    report: LossReport
    modern: bool = False
    root: Element = field(default_factory=lambda: Element("scene"))
    _materials: dict[int, tuple[Material, str]] = field(default_factory=dict)
    _taken: set[str] = field(default_factory=set)

    # --- elements ------------------------------------------------------------------------------------------------

    def name(self, text: str) -> str:
        """A property's name in the flavour that is written."""
        if not self.modern:
            return text
        return _NEW_NAMES.get(text) or re.sub(r"(?<!^)(?=[A-Z])", "_", text).lower()

    def plugin(self, tag: str, kind: str, parent: Element | None = None, **named: str) -> Element:
        """An element of a kind."""
        made = Element(tag, {"type": kind, **named})
        if parent is not None:
            parent.append(made)
        return made

    def put(self, parent: Element, tag: str, name: str, value: str) -> None:
        """A property."""
        ElementTree.SubElement(parent, tag, {"name": self.name(name), "value": value})

    def matrix(self, parent: Element, name: str, matrix: Matrix) -> None:
        """A transform."""
        holder = ElementTree.SubElement(parent, "transform", {"name": self.name(name)})
        ElementTree.SubElement(holder, "matrix", {"value": " ".join(repr(float(value)) for value in matrix.ravel())})

    def color(self, parent: Element, name: str, value: Rgb) -> None:
        """A colour, linear."""
        self.put(parent, "rgb", name, ", ".join(number(part) for part in value))

    # --- the scene -----------------------------------------------------------------------------------------------

    def write(self, scene: Scene) -> None:
        """Writes a scene."""
        self.root.set("version", "3.0.0" if self.modern else "0.5.0")
        self._integrator(scene)
        self._sensor(scene)
        for name, material in scene.materials.items():
            self.material(material, name)
        for light in (*scene.lights, *([scene.background] if scene.background is not None else [])):
            self._emitter(light)
        if scene.background is not None:
            self.report.add(scene.name or "scene", "a background that is seen and does not light", "one that lights")
        if scene.ambient != (0.0, 0.0, 0.0):
            self.report.add(scene.name or "scene", "constant ambient light")
        if scene.duration_s:
            self.report.add(scene.name or "scene", "an animation over many frames", "its first frame")
        for instance in scene.instances:
            self._shape(instance)

    def _integrator(self, scene: Scene) -> None:
        kind, depth = _INTEGRATORS[scene.integrator.kind], scene.integrator.depth
        if self.modern and kind in ("bdpt", "photonmapper", "pssmlt"):
            self.report.add("integrator", scene.integrator.kind, "path")
            kind = "path"
        if scene.integrator.kind == "whitted":
            kind = "path"  # follows mirrors and glass
            self.report.add("integrator", "whitted", "path")
        made = self.plugin("integrator", kind, self.root)
        if kind != "direct":
            self.put(made, "integer", "maxDepth", str(depth if depth < 0 else depth + 1))
        elif depth != 1:
            self.report.add("integrator", f"a depth of {depth}", "direct light")

    def _sensor(self, scene: Scene) -> None:
        camera, film = scene.camera, scene.film
        made = self._camera(camera)
        self.root.append(made)
        kind = _SAMPLERS[scene.sampler.kind]
        if self.modern and kind in ("sobol", "halton", "hammersley"):
            self.report.add("sampler", kind, "independent")
            kind = "independent"
        sampler = self.plugin("sampler", kind, made)
        self.put(sampler, "integer", "sampleCount", str(scene.sampler.samples_per_pixel))
        holder = self.plugin("film", "hdrfilm", made)
        self.put(holder, "integer", "width", str(film.width_px))
        self.put(holder, "integer", "height", str(film.height_px))
        rfilter = self.plugin("rfilter", _FILTERS[film.filter], holder)
        if self.modern:
            if film.filter == "tent":
                self.put(rfilter, "float", "radius", number(film.filter_radius_px))
            elif film.filter != "box":
                self.report.add("film", f"a filter of radius {film.filter_radius_px:g}", "the width it has by default")
        else:
            self.put(rfilter, "float", "radius", number(film.filter_radius_px))

    def _camera(self, camera: Camera) -> Element:
        track = getattr(camera, "track", None)
        if track is not None:
            self.report.add("camera", "the motion of the camera", "its place at the start")
        to_world = placed(track, camera.to_world) @ FORWARD
        if isinstance(camera, PerspectiveCamera):
            made = self.plugin("sensor", "thinlens" if camera.lens_radius > 0.0 else "perspective")
            self.put(made, "float", "fov", number(camera.fov_deg))
            self.put(made, "string", "fovAxis", "smaller")
            if camera.lens_radius > 0.0:
                self.put(made, "float", "apertureRadius", number(camera.lens_radius))
            if camera.lens_radius > 0.0 or (camera.focal_distance != FAR and not self.modern):
                self.put(made, "float", "focusDistance", number(camera.focal_distance))
            for name, value in zip(("shutterOpen", "shutterClose"), camera.shutter_s, strict=True):
                if camera.shutter_s != (0.0, 0.0):
                    self.put(made, "float", name, number(value))
        elif isinstance(camera, OrthographicCamera):
            made = self.plugin("sensor", "orthographic")
            half = camera.half_width
            to_world = to_world @ np.diag([half, half, 1.0, 1.0])
        else:
            made = self.plugin("sensor", "spherical" if isinstance(camera, EnvironmentCamera) else "perspective")
            if self.modern or not isinstance(camera, EnvironmentCamera):
                self.report.add("camera", type(camera).__name__, "one that the target may not have")
        self.matrix(made, "toWorld", to_world)
        return made

    # --- textures and materials ----------------------------------------------------------------------------------

    def texture(self, parent: Element, texture: Texture, name: str) -> None:
        """A texture or colour as a property."""
        if isinstance(texture, ConstantTexture):
            self.color(parent, name, texture.value)
            return
        if isinstance(texture, ImageTexture):
            made = self.plugin("texture", "bitmap", parent, name=self.name(name))
            self.put(made, "string", "filename", self.output.picture(texture.image, texture.source))
            self.put(made, "string", "wrapMode", "clamp" if texture.wrap == "black" and self.modern else
                     {"repeat": "repeat", "clamp": "clamp", "black": "zero"}[texture.wrap])  # fmt: skip
            kind = {"nearest": "nearest", "bilinear": "trilinear", "mipmap": "ewa"}[texture.filter]
            if texture.filter == "bilinear" and not self.modern:
                self.report.add(name, "a texture without levels of detail", "trilinear")
            if self.modern:
                kind = "nearest" if texture.filter == "nearest" else "bilinear"
            self.put(made, "string", "filterType", kind)
            # the first row is at v = 0 here
            self._uv(
                made, (texture.uv_scale[0], -texture.uv_scale[1]), (texture.uv_offset[0], 1.0 - texture.uv_offset[1])
            )
        elif isinstance(texture, CheckerboardTexture):
            made = self.plugin("texture", "checkerboard", parent, name=self.name(name))
            self.texture(made, texture.even, "color0")
            self.texture(made, texture.odd, "color1")
            self._uv(made, (0.5 * texture.uv_scale[0], 0.5 * texture.uv_scale[1]), (0.0, 0.0))
        else:
            self.report.add(name, f"texture {type(texture).__name__}", "its mean")
            self.color(parent, name, mean_of(texture))

    def _uv(self, made: Element, scale: tuple[float, float], offset: tuple[float, float]) -> None:
        if self.modern:
            holder = ElementTree.SubElement(made, "transform", {"name": "to_uv"})
            size = {"x": number(scale[0]), "y": number(scale[1]), "z": "1"}
            ElementTree.SubElement(holder, "scale", size)
            ElementTree.SubElement(holder, "translate", {"x": number(offset[0]), "y": number(offset[1]), "z": "0"})
            return
        for name, value in zip(("uscale", "vscale", "uoffset", "voffset"), (*scale, *offset), strict=True):
            if value != (0.0 if name.endswith("offset") else 1.0):
                self.put(made, "float", name, number(value))

    def material(self, material: Material, name: str = "") -> str:
        """Identifier of a material, written before where it is new."""
        if id(material) not in self._materials:
            wanted = re.sub(r"[^\w.-]", "_", name) or "m"
            label, count = wanted, 1
            while label in self._taken:
                count += 1
                label = f"{wanted}{count}"
            self._taken.add(label)
            made = self.bsdf(material, f"material {name or type(material).__name__!r}")
            made.set("id", label)
            self.root.append(made)
            self._materials[id(material)] = material, label
        return self._materials[id(material)][1]

    def bsdf(self, material: Material, where: str) -> Element:
        """The element of a material; opaque ones have two sides."""
        if isinstance(material, Masked):
            made = self.plugin("bsdf", "mask")
            self.texture(made, material.opacity, "opacity")
            made.append(self.bsdf(material.base, where))
            return made
        if isinstance(material, MixMaterial):
            made = self.plugin("bsdf", "blendbsdf")
            self.texture(made, material.amount, "weight")
            for part in (material.first, material.second):
                made.append(self.bsdf(part, where))
            return made
        if isinstance(material, Bumped):
            made = self.plugin("bsdf", "bumpmap" if self.modern else "bump")
            self.texture(made, material.height, "map")
            if isinstance(material.height, ConstantTexture):
                return self.bsdf(material.base, where)
            made.append(self.bsdf(material.base, where))
            return made
        if isinstance(material, HeightField):
            self.report.add(where, "a height field", "its material, flat")
            return self.bsdf(material.base, where)
        if isinstance(material, Glass):
            return self._glass(material, where)
        if isinstance(material, Translucent):
            return self._translucent(material, where)
        both = self.plugin("bsdf", "twosided")
        both.append(self._opaque(material, where))
        return both

    def _opaque(self, material: Material, where: str) -> Element:
        if isinstance(material, Matte):
            rough = material.sigma_deg > 0.0 and not self.modern
            made = self.plugin("bsdf", "roughdiffuse" if rough else "diffuse")
            self.texture(made, material.reflectance, "reflectance")
            if rough:
                self.put(made, "float", "alpha", number(math.tan(math.radians(material.sigma_deg)) * math.sqrt(2.0)))
            elif material.sigma_deg:
                self.report.add(where, f"a roughness of {material.sigma_deg:g} degrees", "smooth")
            return made
        if isinstance(material, Mirror):
            if material.spread_deg:
                self.report.add(where, "rays spread about the mirrored one", "a sharp mirror")
            made = self.plugin("bsdf", "conductor")
            self.put(made, "string", "material", "none")
            self.texture(made, material.reflectance, "specularReflectance")
            return made
        if isinstance(material, Metal):
            smooth = material.roughness == (0.0, 0.0)
            made = self.plugin("bsdf", "conductor" if smooth else "roughconductor")
            self.color(made, "eta", material.eta)
            self.color(made, "k", material.k)
            if not self.modern:
                self.put(made, "float", "extEta", "1")
            if material.reflectance_scale != ConstantTexture((1.0, 1.0, 1.0)):
                self.texture(made, material.reflectance_scale, "specularReflectance")
            if not smooth:
                self.put(made, "string", "distribution", material.distribution)
                self._alphas(made, material.roughness)
            return made
        if isinstance(material, Emissive):
            made = self.plugin("bsdf", "diffuse")
            self.color(made, "reflectance", (0.0, 0.0, 0.0))
            return made
        if isinstance(material, Phong) and not self.modern:
            if material.fresnel_max > 0.0:
                self.report.add(where, "the mirror of Phong reflection", "left out")
            made = self.plugin("bsdf", "phong")
            self.texture(made, material.diffuse, "diffuseReflectance")
            self.color(made, "specularReflectance", material.specular)
            self.put(made, "float", "exponent", number(material.exponent))
            return made
        return self._plastic(material, where)

    def _plastic(self, material: Material, where: str) -> Element:
        """A dielectric coat over a diffuse base, or what comes nearest to it."""
        if isinstance(material, Plastic):
            parts = material.diffuse, material.specular, material.ior, material.roughness
        elif isinstance(material, Glossy | Uber):
            # the coat's share at normal incidence is that of Fresnel's equations times the factor
            alpha = math.sqrt(material.roughness[0] * material.roughness[1])
            wanted = np.array(mean_of(material.specular)) / (0.04 if isinstance(material, Glossy) else 1.0)
            factor = rgb(np.minimum(wanted, 1.0))
            if (wanted > 1.0).any():
                self.report.add(where, "a coat that reflects more than 4 %", "one that reflects as much")
            parts = material.diffuse, ConstantTexture(factor), 1.5, alpha
            self.report.add(where, type(material).__name__.lower(), f"rough plastic of alpha {alpha:.3g}")
        else:
            assert isinstance(material, Phong)
            alpha = math.sqrt(2.0 / (material.exponent + 2.0))
            parts = material.diffuse, ConstantTexture((1.0, 1.0, 1.0)), 1.5, alpha
            self.report.add(where, "Phong reflection", f"rough plastic of alpha {alpha:.3g}")
        made = self.plugin("bsdf", "roughplastic" if parts[3] > 0.0 else "plastic")
        self.texture(made, parts[0], "diffuseReflectance")
        self.texture(made, parts[1], "specularReflectance")
        self.put(made, "float", "intIOR", number(parts[2]))
        self.put(made, "float", "extIOR", "1")
        if parts[3] > 0.0:
            self.put(made, "float", "alpha", number(parts[3]))
        return made

    def _alphas(self, made: Element, alphas: tuple[float, float]) -> None:
        if alphas[0] == alphas[1]:
            self.put(made, "float", "alpha", number(alphas[0]))
        else:
            self.put(made, "float", "alphaU", number(alphas[0]))
            self.put(made, "float", "alphaV", number(alphas[1]))

    def _glass(self, material: Glass, where: str) -> Element:
        if material.spread_deg:
            self.report.add(where, "rays spread about the perfect ones", "clear glass")
        rough = material.roughness != (0.0, 0.0)
        if rough and material.thin:
            self.report.add(where, "a rough pane", "a clear one")
        kind = "thindielectric" if material.thin else "roughdielectric" if rough else "dielectric"
        made = self.plugin("bsdf", kind)
        self.put(made, "float", "intIOR", number(material.ior))
        self.put(made, "float", "extIOR", "1")
        for texture, name in (
            (material.reflectance, "specularReflectance"),
            (material.transmittance, "specularTransmittance"),
        ):
            if texture != ConstantTexture((1.0, 1.0, 1.0)):
                self.texture(made, texture, name)
        if kind == "roughdielectric":
            self.put(made, "string", "distribution", "ggx")
            self._alphas(made, material.roughness)
        return made

    def _translucent(self, material: Translucent, where: str) -> Element:
        if self.modern:
            self.report.add(where, "diffuse transmission", "diffuse reflection alone")
        if self.modern or mean_of(material.transmittance) == (0.0, 0.0, 0.0):
            both = self.plugin("bsdf", "twosided")
            self.texture(self.plugin("bsdf", "diffuse", both), material.reflectance, "reflectance")
            return both
        if mean_of(material.reflectance) == (0.0, 0.0, 0.0):
            made = self.plugin("bsdf", "difftrans")
            self.texture(made, material.transmittance, "transmittance")
            return made
        self.report.add(where, "diffuse reflection beside transmission", "a mixture of both")
        made = self.plugin("bsdf", "mixturebsdf")
        self.put(made, "string", "weights", "0.5, 0.5")
        both = self.plugin("bsdf", "twosided", made)
        twice = [
            ConstantTexture(rgb(2.0 * np.array(mean_of(part))))
            for part in (material.reflectance, material.transmittance)
        ]
        self.texture(self.plugin("bsdf", "diffuse", both), twice[0], "reflectance")
        self.texture(self.plugin("bsdf", "difftrans", made), twice[1], "transmittance")
        return made

    # --- lights and shapes ---------------------------------------------------------------------------------------

    def _emitter(self, light: Light) -> None:
        if isinstance(light, PointLight):
            made = self.plugin("emitter", "point", self.root)
            place = {axis: number(value) for axis, value in zip("xyz", light.position, strict=True)}
            ElementTree.SubElement(made, "point", {"name": "position", **place})
            self.color(made, "intensity", light.intensity)
        elif isinstance(light, SpotLight):
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

    def _daylight(self, light: SunSky) -> None:
        """Directions are those of the world here; the transform turns the zenith, y or in Mitsuba 3 z."""
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
                self.put(made, "float", f"{part}Scale", number(light.scale if light.part in (part, "both") else 0.0))
        else:
            self.put(made, "float", "scale", number(light.scale))
        turn = facing_up(light.up, 2 if self.modern else 1)
        if not np.array_equal(turn, np.eye(4)):
            self.matrix(made, "toWorld", turn)

    def _shape(self, instance: Instance) -> None:
        shape, material = instance.shape, instance.material
        where = instance.name or "shape"
        label = self.material(material)
        if instance.track is not None:
            self.report.add(where, "the motion of a shape", "its place at the start")
        to_world = placed(instance.track, instance.to_world)
        kinds: dict[type, str] = {Sphere: "sphere", Disk: "disk", Rectangle: "rectangle", Cube: "cube", Mesh: "ply"}
        made = self.plugin("shape", kinds[type(shape)], self.root)
        if isinstance(shape, Mesh):
            self.put(made, "string", "filename", self.output.mesh(shape))
            if shape.normals is None:
                self.put(made, "boolean", "faceNormals", "true")
        elif isinstance(shape, Sphere):
            self.put(made, "float", "radius", number(shape.radius))
        elif isinstance(shape, Disk):
            to_world = to_world @ np.diag([shape.radius, shape.radius, 1.0, 1.0])
        if not np.array_equal(to_world, np.eye(4)):
            self.matrix(made, "toWorld", to_world)
        ElementTree.SubElement(made, "ref", {"id": label})
        emission = material.radiance if isinstance(material, Emissive) else instance.emission
        if isinstance(material, Emissive):
            self.report.add(where, "a surface that shines on both sides", "on its front")
        if emission is not None:
            self.color(self.plugin("emitter", "area", made), "radiance", emission)


def save_mitsuba(scene: Scene, output: Output, report: LossReport, modern: bool = False) -> None:
    """Writes a scene and what belongs to it; nothing is in place until the output is."""
    writer = MitsubaWriter(output, report, modern)
    writer.write(scene)
    ElementTree.indent(writer.root, "\t")
    output.text(output.path.name, ElementTree.tostring(writer.root, "unicode", xml_declaration=True) + "\n")


def save_mitsuba3(scene: Scene, output: Output, report: LossReport) -> None:
    """The same for Mitsuba 3."""
    save_mitsuba(scene, output, report, modern=True)
