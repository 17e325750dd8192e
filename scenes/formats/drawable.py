"""Conversion of a canonical scene to what this project's renderer supports; other parts are replaced, which is
reported.

Microfacets of alpha ``α`` are approximated by a uniform cone of mirrored rays of half angle ``2 atan α``, because a
facet of slope ``α`` deflects a ray by twice its angle.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Literal

import numpy as np

from scenes.arithmetic import arctan, product
from scenes.canonical import (
    Bumped,
    CheckerboardTexture,
    ConstantTexture,
    Cube,
    Curves,
    Disk,
    Emissive,
    EnvironmentCamera,
    Glass,
    Glossy,
    ImageTexture,
    Instance,
    Light,
    Masked,
    Material,
    Matte,
    Metal,
    MetallicRough,
    Mirror,
    MixMaterial,
    NormalMapped,
    OrthographicCamera,
    PerspectiveCamera,
    Phong,
    Plastic,
    RealisticCamera,
    Rectangle,
    Scene,
    Sphere,
    SpotLight,
    SunSky,
    Texture,
    Translucent,
    Uber,
)
from scenes.daylight import sky_map, sun_light
from scenes.formats.appearance.facets import with_even_facets
from scenes.formats.appearance.folding import folded, mean_of
from scenes.formats.appearance.glass import lose_front
from scenes.formats.appearance.indices import reflectance_of_index
from scenes.formats.appearance.media import without_media
from scenes.formats.appearance.simpler import simpler
from scenes.formats.appearance.spectra import rgb
from scenes.formats.appearance.spot_profiles import reshaped
from scenes.formats.geometry.meshed import as_mesh, cube_sides, depends_on_uv, of_radius_one
from scenes.formats.geometry.placing import lose_back, lose_shine_behind
from scenes.formats.losses import LossReport
from scenes.models.phong_of_parts import EXPONENT_MAX

PATH_MATERIALS = Matte | Glass | Metal | MetallicRough | Masked | Bumped | NormalMapped
"""Materials that path tracing supports without replacement, besides layered plastic."""

DEPTH_MAX = 8
"""Maximum number of bounces of mirrored and refracted rays."""

_SMOOTH = 0.02  # alpha below which a mirror is rendered as perfect


class Approximation:
    """Replaces parts of a scene, each part once."""

    def __init__(self, report: LossReport, paths: bool = False) -> None:
        self.report, self.paths = report, paths
        self._materials: dict[int, tuple[Material, Material]] = {}
        self._textures: dict[int, tuple[Texture, Texture]] = {}

    def scene(self, scene: Scene) -> Scene:
        """The scene with all unsupported parts replaced."""
        scene = without_media(scene, self.report)
        camera, depth = scene.camera, scene.integrator.depth
        if isinstance(camera, RealisticCamera):
            self.report.add("camera", "a camera with lenses", "a pinhole of 45 degrees")
            camera = PerspectiveCamera(camera.to_world)
        if isinstance(camera, PerspectiveCamera) and camera.shift != (0.0, 0.0):
            self.report.add("camera", "a picture off the viewing direction", "one about it")
            camera = dataclasses.replace(camera, shift=(0.0, 0.0))
        assert isinstance(camera, PerspectiveCamera | OrthographicCamera | EnvironmentCamera)
        if (depth < 0 or depth > DEPTH_MAX) and not self.paths:
            self.report.add("integrator", f"{'endless' if depth < 0 else depth} bounces", f"{DEPTH_MAX}")
            depth = DEPTH_MAX
        if self.paths and scene.integrator.kind != "whitted":
            depth = (
                depth - 1 if depth > 0 else depth
            )  # files count the bounce whose light is direct, the renderer does not
        kind = "path" if self.paths else "direct" if scene.integrator.kind == "direct" else "whitted"
        if scene.integrator.kind not in (kind, "whitted", "direct"):
            became = "paths from the camera" if self.paths else "direct light, mirrors, glass"
            self.report.add("integrator", f"{scene.integrator.kind}: light between surfaces", became)
        lights = tuple(made for light in scene.lights for made in self.light(light))
        instances = tuple(
            made for number, instance in enumerate(scene.instances) for made in self.instance(instance, number)
        )
        integrator = dataclasses.replace(scene.integrator, kind=kind, depth=depth)
        return dataclasses.replace(scene, camera=camera, lights=lights, instances=instances, integrator=integrator)

    def light(self, light: Light) -> list[Light]:
        """Lights that are supported: daylight becomes an environment map and a directional light with the sun's
        width."""
        if isinstance(light, SpotLight):
            return [reshaped(light, "hermite", self.report)]
        if not isinstance(light, SunSky):
            return [light]
        made: list[Light] = [] if light.part == "sky" else [sun_light(light)]
        if light.part != "sun":
            sky = sky_map(light)
            self.report.add("light", "the analytic sky", f"a map of {sky.image.shape[0]} rows")
            made.append(sky)
        return made

    def instance(self, instance: Instance, number: int) -> list[Instance]:
        """Instances for a shape. Lamps must be rectangles or spheres: a cube becomes six rectangles, a disk a square,
        and other shapes only glow."""
        name = instance.name or f"shape {number}"
        named = dataclasses.replace(instance, name=name)
        lose_back(named, self.report)
        if instance.emission is not None and isinstance(instance.shape, Rectangle | Disk):
            lose_shine_behind(named, self.report)
        made = dataclasses.replace(instance, material=self.material(instance.material, name), name=name)
        if isinstance(instance.shape, Curves):
            mesh = as_mesh(instance.shape)
            self.report.add(name, "curves", f"a mesh of {len(mesh.faces)} triangles")
            made = dataclasses.replace(made, shape=mesh)
        if instance.emission is None:
            if isinstance(instance.shape, Cube | Disk) and depends_on_uv(made.material):
                made = of_radius_one(made)
                return [dataclasses.replace(made, shape=as_mesh(made.shape))]
            return [made]
        if isinstance(instance.shape, Rectangle | Sphere):
            return [made]
        if isinstance(instance.shape, Cube):
            places = [product(instance.to_world, side) for side in cube_sides()]
            return [dataclasses.replace(made, shape=Rectangle(), to_world=place) for place in places]
        if isinstance(instance.shape, Disk):
            side = math.sqrt(math.pi) / 2.0 * instance.shape.radius
            self.report.add(name, "a round lamp", "a square one of the same area")
            scaled = product(instance.to_world, np.diag([side, side, 1.0, 1.0]))
            return [dataclasses.replace(made, shape=Rectangle(), to_world=scaled)]
        if not self.paths:  # paths find it by chance
            self.report.add(name, "a lamp of triangles", "a surface that glows and lights nothing")
        return [dataclasses.replace(made, material=Emissive(instance.emission), emission=None)]

    def texture(self, texture: Texture, where: str) -> Texture:
        """A plain texture; products and mixtures that cannot be folded become their means."""
        if id(texture) not in self._textures:
            self._textures[id(texture)] = texture, self._texture(folded(texture), where)
        return self._textures[id(texture)][1]

    def _texture(self, texture: Texture, where: str) -> Texture:
        if isinstance(texture, ConstantTexture | ImageTexture):
            return texture
        if isinstance(texture, CheckerboardTexture):
            parts = self.texture(texture.even, where), self.texture(texture.odd, where)
            same = parts[0] is texture.even and parts[1] is texture.odd
            return texture if same else CheckerboardTexture(*parts, texture.uv_scale)
        self.report.add(where, f"texture {type(texture).__name__}", "its mean")
        return ConstantTexture(mean_of(texture))

    def material(self, material: Material, where: str) -> Material:
        """A supported material; the same object if it is supported."""
        if id(material) not in self._materials:
            self._materials[id(material)] = material, self._material(material, where)
        return self._materials[id(material)][1]

    def _material(self, material: Material, where: str) -> Material:
        if isinstance(material, Glass):
            lose_front(material, where, self.report)
        if isinstance(material, Metal | Glass | Glossy | Plastic):
            material = with_even_facets(material, where, self.report)
        if isinstance(material, MetallicRough) and not self.paths:
            return self.material(simpler(material, where, self.report), where)
        if self.paths and (
            isinstance(material, PATH_MATERIALS) or (isinstance(material, Plastic) and material.layered)
        ):
            return self._along_paths(material, where)
        if isinstance(material, Matte):
            if material.sigma_deg:
                self.report.add(where, f"a roughness of {material.sigma_deg:g} degrees", "smooth")
            base = self.texture(material.reflectance, where)
            return material if base is material.reflectance and not material.sigma_deg else Matte(base)
        if isinstance(material, Glass):
            return self._glass(material, where)
        if isinstance(material, Metal):
            return self._metal(material, where)
        if isinstance(material, Glossy | Plastic | Uber):
            return self._coated(material, where)
        if isinstance(material, Translucent):
            self.report.add(where, "light through a translucent surface", "left out")
            return Matte(self.texture(material.reflectance, where))
        if isinstance(material, MixMaterial):
            share = float(np.mean(mean_of(material.amount)))
            kept = material.second if share > 0.5 else material.first
            self.report.add(
                where, "a mixture of materials", f"the one with the greater share ({max(share, 1 - share):.2g})"
            )
            return self.material(kept, where)
        if isinstance(material, Masked | Bumped | NormalMapped):
            what = "holes in a material" if isinstance(material, Masked) else "bumps"
            self.report.add(where, what, "none")
            return self.material(material.base, where)
        return material

    def _along_paths(self, material: Material, where: str) -> Material:
        """A material with microfacets, holes or perturbed normals, which path tracing supports."""
        changed: dict[str, object] = {}
        for field in dataclasses.fields(material):
            value = getattr(material, field.name)
            if isinstance(value, Texture):
                changed[field.name] = self.texture(value, where)
            elif isinstance(value, Material):
                changed[field.name] = self.material(value, where)
        if isinstance(material, Metal | Glass) and material.roughness[0] != material.roughness[1]:
            alpha = math.sqrt(material.roughness[0] * material.roughness[1])
            self.report.add(where, f"facets of two alphas {material.roughness}", f"of one, {alpha:.3g}")
            changed["roughness"] = alpha, alpha
        if isinstance(material, Glass) and material.thin and max(material.roughness) > 0.0:
            self.report.add(where, "a rough pane", "a clear one")
            changed["roughness"] = 0.0, 0.0
        if all(value is getattr(material, name) for name, value in changed.items()):
            return material
        return dataclasses.replace(material, **changed)  # type: ignore[arg-type]

    def _glass(self, material: Glass, where: str) -> Material:
        sides = self.texture(material.reflectance, where), self.texture(material.transmittance, where)
        alpha = math.sqrt(material.roughness[0] * material.roughness[1])
        if alpha == 0.0 and sides == (material.reflectance, material.transmittance):
            return material
        if alpha > 0.0:
            self.report.add(where, f"glass of alpha {alpha:.3g}", f"rays spread over {spread_deg(alpha):.3g} degrees")
        spread = spread_deg(alpha) if alpha > 0.0 else material.spread_deg
        return Glass(*sides, material.ior, (0.0, 0.0), material.thin, spread)

    def _metal(self, material: Metal, where: str) -> Material:
        """A mirror with the colour of the metal at normal incidence."""
        color = np.array(reflectance_of_index(material.eta, material.k)) * mean_of(material.reflectance_scale)
        alpha = math.sqrt(material.roughness[0] * material.roughness[1])
        spread = spread_deg(alpha) if alpha > _SMOOTH else 0.0
        self.report.add(where, "metal", f"a mirror of its colour, spread over {spread:.3g} degrees")
        return Mirror(ConstantTexture(rgb(np.minimum(color, 1.0))), spread)

    def _coated(self, material: Glossy | Plastic | Uber, where: str) -> Material:
        """A Phong material with a highlight as wide as that of the facets, or with a mirror if the coat is smooth."""
        base = self.texture(material.diffuse, where)
        coat = np.array(mean_of(material.specular))
        if isinstance(material, Plastic):
            straight = ((material.ior - 1.0) / (material.ior + 1.0)) ** 2
            alpha, coat = material.roughness, straight * coat
        else:
            alpha = math.sqrt(material.roughness[0] * material.roughness[1])
            coat = 0.04 * coat if isinstance(material, Uber) else coat
        amount = float(np.clip(coat.mean(), 0.0, 1.0))
        exponent = float(np.clip(2.0 / max(alpha, 1e-3) ** 2 - 2.0, 1.0, EXPONENT_MAX))
        mirrored = amount if alpha <= 0.2 else 0.0
        what = f"Phong with a highlight of exponent {exponent:.3g}"
        self.report.add(where, f"{type(material).__name__.lower()} of alpha {alpha:.3g}", what)
        room = np.maximum(1.0 - np.array(mean_of(base)), 0.0)
        return Phong(
            base,
            rgb(np.minimum(coat, room)),
            exponent,
            0.0,
            mirrored,
            1.0 if mirrored else 0.0,
            mirror_spread_deg=spread_deg(alpha) if mirrored and alpha > _SMOOTH else 0.0,
        )


def spread_deg(alpha: float) -> float:
    """Full angle of the cone over which facets of an alpha spread rays, degrees."""
    return min(180.0, math.degrees(4.0 * arctan(alpha)))


def drawable(scene: Scene, report: LossReport, integrator: Literal["whitted", "path"] = "whitted") -> Scene:
    """A scene that this project's renderer supports.

    Args:
        scene: any canonical scene.
        report: receives the replacements.
        integrator: integrator that will render it.
    """
    return Approximation(report, integrator == "path").scene(scene)
