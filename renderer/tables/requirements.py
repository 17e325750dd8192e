"""Features that a scene requires of the kernels, so that they are compiled without the others."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from renderer.kernels.entry import kept_count
from renderer.layout.features import MEANING, PACKETS, Feature
from renderer.tables.scattering import unwrapped
from scenes.canonical import (
    Bumped,
    CheckerboardTexture,
    Cube,
    DirectionalLight,
    Disk,
    Emissive,
    EnvironmentCamera,
    EnvironmentLight,
    Glass,
    HeightField,
    ImageTexture,
    Instance,
    Masked,
    Material,
    Matte,
    Mesh,
    Metal,
    MetallicRough,
    Mirror,
    NormalMapped,
    OrthographicCamera,
    PerspectiveCamera,
    Phong,
    Plastic,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
    SpotLight,
    Texture,
)

_EXTENDED = Feature.SUN_DISC | Feature.QUAD | Feature.SPHERE_LIGHT | Feature.ENVIRONMENT
_LIGHTING = _EXTENDED | Feature.POINT | Feature.DIRECTIONAL | Feature.SPOT | Feature.ALL_CELLS
_SHAPES = {Mesh: Feature.MESH, Sphere: Feature.SPHERE, Rectangle: Feature.FLAT, Disk: Feature.FLAT, Cube: Feature.CUBE}


def explain(scene: Scene) -> dict[Feature, str]:
    """Required features, each with the first part of the scene that requires it."""
    found: dict[Feature, str] = {}
    scene = lit_by_all(scene)
    lit = any(_is_lit(instance.material) for instance in scene.instances)
    for feature, cause in _required(scene):
        if lit or not feature & _LIGHTING:
            found.setdefault(feature, cause)
    return {feature: found[feature] for feature in Feature if feature in found}


def required(scene: Scene) -> Feature:
    """The features of a scene, as one set."""
    features = Feature(0)
    for feature in explain(scene):
        features |= feature
    return features


def explanation(scene: Scene) -> list[str]:
    """Lines that state for every feature whether a scene requires it, and which part does."""
    found = explain(scene)
    lines = [
        f"{'yes' if feature in found else ' - '}  {MEANING[feature]:44} {found.get(feature, '')}" for feature in Feature
    ]
    alone = "one by one, by separate kernels" if required(scene) & ~PACKETS else "in packets of sixteen"
    kept = f"kernels for {kept_count()} sets of features are kept on this machine"
    return [*(line.rstrip() for line in lines), f"samples are traced {alone}; {kept}"]


def lit_by_all(scene: Scene) -> Scene:
    """A scene prepared for path tracing: a background without an environment light becomes a light, and ambient light
    is removed, because it approximates the light between surfaces. Other scenes are returned unchanged."""
    if scene.integrator.kind != "path":
        return scene
    lights, background = scene.lights, scene.background
    if background is not None and not any(isinstance(light, EnvironmentLight) for light in lights):
        lights, background = (*lights, background), None
    return dataclasses.replace(scene, lights=lights, background=background, ambient=(0.0, 0.0, 0.0))


def _required(scene: Scene) -> Iterator[tuple[Feature, str]]:
    yield from _of_camera(scene)
    if scene.integrator.kind == "path":
        yield Feature.PATHS, "Integrator.kind"
    for instance in scene.instances:
        yield from _of_instance(instance, scene)
    for light in scene.lights:
        for feature in _of_light(light):
            yield feature, type(light).__name__
            if feature & _EXTENDED and scene.integrator.shadow_rays == "all":
                yield Feature.ALL_CELLS, "Integrator.shadow_rays"
    if scene.background is not None:
        yield Feature.SKY, "Scene.background"


def _of_camera(scene: Scene) -> Iterator[tuple[Feature, str]]:
    camera = scene.camera
    if isinstance(camera, PerspectiveCamera) and camera.lens_radius > 0.0:
        yield Feature.LENS, f"PerspectiveCamera.lens_radius {camera.lens_radius:g}"
    if isinstance(camera, OrthographicCamera):
        yield Feature.PARALLEL, "OrthographicCamera"
    if isinstance(camera, EnvironmentCamera):
        yield Feature.PANORAMA, "EnvironmentCamera"
    if getattr(camera, "track", None) is not None:
        yield Feature.MOTION, f"{type(camera).__name__}.track"


def _of_instance(instance: Instance, scene: Scene) -> Iterator[tuple[Feature, str]]:
    where = f"instance {instance.name!r}"
    relief = isinstance(instance.material, HeightField)
    if relief:
        yield Feature.HEIGHT_FIELD, where
    elif type(instance.shape) in _SHAPES:
        yield _SHAPES[type(instance.shape)], where
    if instance.track is not None:
        yield Feature.MOTION, where
    if instance.emission is not None and max(instance.emission) > 0.0:
        yield Feature.QUAD if isinstance(instance.shape, Rectangle) else Feature.SPHERE_LIGHT, where
        if scene.integrator.shadow_rays == "all":
            yield Feature.ALL_CELLS, "Integrator.shadow_rays"
    for feature in _of_material(instance.material, scene):
        yield feature, where


def _of_material(material: Material, scene: Scene) -> Iterator[Feature]:
    several = scene.integrator.reflection_rays > 1 and scene.integrator.kind != "path"
    if isinstance(material, HeightField | Masked | Bumped | NormalMapped):
        yield from _of_material(material.base, scene)
    if isinstance(material, Masked):
        yield from _of_texture(material.opacity)
        yield Feature.PASSING
    if isinstance(material, Bumped | NormalMapped):
        yield from _of_texture(material.height if isinstance(material, Bumped) else material.normals)
        yield Feature.BENT
    if isinstance(material, Phong):
        yield from _of_texture(material.diffuse)
        if max(material.specular) > 0.0:
            yield Feature.HIGHLIGHT
        if material.fresnel_max > 0.0:
            yield Feature.MIRROR
            if material.mirror_spread_deg > 0.0:
                yield Feature.GLOSSY
    if isinstance(material, Matte):
        yield from _of_texture(material.reflectance)
    if isinstance(material, Mirror | Glass):
        yield from _of_texture(material.reflectance)
        yield Feature.MIRROR
        if material.spread_deg > 0.0:
            yield Feature.GLOSSY
    if isinstance(material, Glass):
        yield from _of_texture(material.transmittance)
        yield Feature.GLASS
        several = several or (scene.integrator.refraction_rays > 1 and scene.integrator.kind != "path")
        if scene.integrator.kind == "path" and material.thin and material.spread_deg == 0.0:
            yield Feature.PASSING
        if max(material.roughness) > 0.0:
            yield Feature.FACETS
    if isinstance(material, Metal | Plastic | MetallicRough):
        yield Feature.FACETS
        for texture in _textures(material):
            yield from _of_texture(texture)
    spread = getattr(material, "spread_deg", getattr(material, "mirror_spread_deg", 0.0))
    if several and spread > 0.0:
        yield Feature.MANY_RAYS


def _is_lit(material: Material) -> bool:
    """Whether a material reflects light from the light sources directly, not only by mirroring and refraction."""
    bare = unwrapped(material)
    return not isinstance(bare, Mirror | Glass | Emissive) or (isinstance(bare, Glass) and max(bare.roughness) > 0.0)


def _textures(material: Metal | Plastic | MetallicRough) -> list[Texture]:
    if isinstance(material, Metal):
        return [material.reflectance_scale]
    if isinstance(material, Plastic):
        return [material.diffuse, material.specular]
    return [texture for texture in (material.base, material.parts, material.glow) if texture is not None]


def _of_texture(texture: Texture) -> Iterator[Feature]:
    if isinstance(texture, ImageTexture):
        yield Feature.IMAGE
    if isinstance(texture, CheckerboardTexture):
        yield Feature.CHECKERBOARD
        yield from _of_texture(texture.even)
        yield from _of_texture(texture.odd)


def _of_light(light: object) -> Iterator[Feature]:
    if isinstance(light, PointLight):
        yield Feature.POINT
    if isinstance(light, DirectionalLight):
        yield Feature.SUN_DISC if light.angle_deg > 0.0 else Feature.DIRECTIONAL
    if isinstance(light, SpotLight):
        yield Feature.SPOT
    if isinstance(light, EnvironmentLight):
        yield Feature.SKY
        yield Feature.ENVIRONMENT
