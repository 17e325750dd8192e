"""Canonical materials as the surface of glTF and of USD: metallic-roughness, with what the extensions of glTF add.

Exact are metallic-roughness surfaces, matte ones, clear and rough glass, panes, what only glows, holes and normal maps.
All others become the nearest such surface, which is reported.

Source: Khronos Group, "glTF 2.0 specification", section 3.9 and appendix B; extensions KHR_materials_clearcoat,
KHR_materials_emissive_strength, KHR_materials_ior, KHR_materials_specular, KHR_materials_transmission,
KHR_materials_volume.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from scenes.canonical import (
    Bumped,
    ConstantTexture,
    Emissive,
    Glass,
    Glossy,
    HeightField,
    Masked,
    Material,
    Matte,
    Metal,
    MetallicRough,
    Mirror,
    MixMaterial,
    NormalMapped,
    Phong,
    Plastic,
    Texture,
    Translucent,
    Uber,
)
from scenes.canonical.textures import WHITE
from scenes.canonical.values import Rgb
from scenes.formats.appearance.facets import with_even_facets
from scenes.formats.appearance.folding import changed, folded, greatest_of, mean_of, product_of
from scenes.formats.appearance.glass import lose_rays
from scenes.formats.appearance.indices import index_of_reflectance, reflectance_of_index
from scenes.formats.appearance.mixtures import is_nothing
from scenes.formats.appearance.normals import is_flat
from scenes.formats.appearance.spectra import grey
from scenes.formats.losses import LossReport

BLACK: Rgb = (0.0, 0.0, 0.0)
Rough = Glass | Metal | Glossy | Plastic


@dataclasses.dataclass(frozen=True)
class Surface(MetallicRough):
    """The metallic-roughness surface, by default of no metal, with what the extensions of glTF add.

    Attributes:
        specular: factor of the reflection of the dielectric part.
        transmitted: whether light passes through.
        thick: whether what it passes through is solid, so that it is refracted; otherwise a pane.
        opacity, cutoff: as in :class:`scenes.canonical.Masked`.
        normals, normal_scale: as in :class:`scenes.canonical.NormalMapped`.
    """

    metallic: float = 0.0
    specular: float = 1.0
    transmitted: bool = False
    thick: bool = False
    opacity: Texture | None = None
    cutoff: float | None = None
    normals: Texture | None = None
    normal_scale: float = 1.0


def surface_of(material: Material, where: str, report: LossReport) -> Surface:
    """The surface of a material; ``where`` is its place in the report of losses."""
    if isinstance(material, MetallicRough):
        given = {field.name: getattr(material, field.name) for field in dataclasses.fields(material)}
        return Surface(**given)
    if isinstance(material, Matte):
        if material.sigma_deg:
            report.add(where, f"a roughness of {material.sigma_deg:g} degrees", "smooth")
        return Surface(material.reflectance, specular=0.0)
    if isinstance(material, Emissive):
        return Surface(ConstantTexture(BLACK), specular=0.0, emission=material.radiance)
    if isinstance(material, Glass):
        return _textured(_glass(material, where, report), material, where, report)
    if isinstance(material, Mirror):
        return _metal(material, where, report)
    if isinstance(material, Metal):
        return _textured(_metal(material, where, report), material, where, report)
    if isinstance(material, Glossy | Plastic):
        return _textured(_coated(material, where, report), material, where, report)
    if isinstance(material, Uber | Phong):
        return _coated(material, where, report)
    if isinstance(material, MixMaterial):
        return _mixed(material, where, report)
    if isinstance(material, Translucent):
        if greatest_of(material.transmittance) > 0.0:
            report.add(where, "diffuse transmission", "diffuse reflection alone")
        return Surface(material.reflectance, specular=0.0)
    if isinstance(material, Masked):
        base = surface_of(material.base, where, report)
        if base.opacity is not None:
            report.add(where, "holes in a surface with holes", "the outer ones")
        return dataclasses.replace(base, opacity=material.opacity, cutoff=material.cutoff)
    if isinstance(material, NormalMapped):
        base = surface_of(material.base, where, report)
        if is_flat(material):
            return base
        if base.normals is not None:
            report.add(where, "a normal map above another", "the outer one")
        return dataclasses.replace(base, normals=material.normals, normal_scale=material.scale)
    assert isinstance(material, HeightField | Bumped)
    if not (isinstance(material, Bumped) and isinstance(material.height, ConstantTexture)):
        what = "a height field" if isinstance(material, HeightField) else "bumps"
        report.add(where, what, "the normals of the shape")
    return surface_of(material.base, where, report)


def roughness_of(alphas: tuple[float, float], where: str, report: LossReport) -> float:
    """The roughness of facets of two alphas, which become one of the same product."""
    if alphas[0] != alphas[1]:
        report.add(where, f"facets of two alphas ({alphas[0]:g}, {alphas[1]:g})", "of one, their geometric mean")
    return min(math.sqrt(math.sqrt(alphas[0] * alphas[1])), 1.0)


def _textured(made: Surface, material: Rough, where: str, report: LossReport) -> Surface:
    """A surface with the texture of the roughness, if its material has one."""
    if material.alpha is None or (made.transmitted and not made.thick):
        return made
    root = changed(
        folded(material.alpha), lambda alphas: np.sqrt(np.clip(alphas, 0.0, 1.0)) * (0.0, 1.0, 0.0) + (0.0, 0.0, 1.0)
    )
    if root is None:
        with_even_facets(material, where, report)
        return made
    return dataclasses.replace(made, roughness=1.0, parts=root)


def _glass(material: Glass, where: str, report: LossReport) -> Surface:
    lose_rays(material, where, report)
    if material.reflectance != WHITE:
        report.add(where, "a factor of the reflection of glass", "1")
    if material.thin and material.roughness != (0.0, 0.0):
        report.add(where, "a rough pane", "a clear one")
    if material.ior < 1.0:
        report.add(where, f"an index of {material.ior:g}", "1")
    roughness = 0.0 if material.thin else roughness_of(material.roughness, where, report)
    ior = max(material.ior, 1.0)
    return Surface(material.transmittance, 0.0, roughness, ior=ior, transmitted=True, thick=not material.thin)


def _metal(material: Mirror | Metal, where: str, report: LossReport) -> Surface:
    """A metal of the colour at normal incidence, which rises to white at grazing angles by Schlick's approximation."""
    if isinstance(material, Mirror):
        if material.spread_deg:
            report.add(where, "rays spread about the mirrored one", "a sharp mirror")
        if material.reflectance != WHITE:
            report.add(where, "a mirror of one colour", "one that is white at grazing angles")
        return Surface(material.reflectance, 1.0, 0.0)
    if material.distribution != "ggx" and material.roughness != (0.0, 0.0):
        report.add(where, f"facets by {material.distribution.capitalize()}", "by GGX, of the same alpha")
    report.add(where, "a metal by its complex index", "by its reflectance at normal incidence")
    straight = ConstantTexture(reflectance_of_index(material.eta, material.k))
    base = product_of(material.reflectance_scale, straight)
    return Surface(base, 1.0, roughness_of(material.roughness, where, report))


def _coated(material: Glossy | Plastic | Uber | Phong, where: str, report: LossReport) -> Surface:
    """A dielectric over its base, whose coat reflects as much at normal incidence."""
    part = "diffuse part" if isinstance(material, Uber) else "base"
    report.add(where, type(material).__name__.lower(), f"a dielectric of glTF over its {part}")
    if isinstance(material, Phong):
        alpha = math.sqrt(2.0 / (material.exponent + 2.0))
        return Surface(material.diffuse, 0.0, roughness_of((alpha, alpha), where, report))
    coat = float(np.clip(np.mean(mean_of(material.specular)), 0.0, 1.0))
    if isinstance(material, Plastic):
        roughness = roughness_of((material.roughness, material.roughness), where, report)
        return Surface(material.diffuse, 0.0, roughness, ior=max(material.ior, 1.0), specular=coat)
    roughness = roughness_of(material.roughness, where, report)
    if isinstance(material, Glossy):
        (ior, _, _), _ = index_of_reflectance(grey(min(coat, 0.9)))
        return Surface(material.diffuse, 0.0, roughness, ior=ior, specular=1.0 if coat > 0.0 else 0.0)
    made = Surface(material.diffuse, 0.0, roughness, ior=max(material.ior, 1.0), specular=coat)
    return made if material.opacity == WHITE else dataclasses.replace(made, opacity=material.opacity)


def _mixed(material: MixMaterial, where: str, report: LossReport) -> Surface:
    """A mixture with nothing is a mask; one of a dielectric and a metal of one base and roughness is metallic in part;
    of others the greater part is kept."""
    for part, other, share in ((material.first, material.second, True), (material.second, material.first, False)):
        if is_nothing(part) and isinstance(material.amount, ConstantTexture):
            amount = material.amount.value
            opacity = amount if share else tuple(1.0 - value for value in amount)
            return surface_of(Masked(other, ConstantTexture(opacity)), where, report)  # type: ignore[arg-type]
    lost = (LossReport(), LossReport())
    first, second = (
        surface_of(part, where, one) for part, one in zip((material.first, material.second), lost, strict=True)
    )
    share = float(np.clip(np.mean(mean_of(material.amount)), 0.0, 1.0))
    even = isinstance(material.amount, ConstantTexture)
    if even and dataclasses.replace(second, metallic=first.metallic, ior=first.ior, specular=first.specular) == first:
        kept = (0, 1)
        metallic = (1.0 - share) * first.metallic + share * second.metallic
        made = dataclasses.replace(first if first.metallic < 1.0 else second, metallic=metallic)
    else:
        kept = (int(share > 0.5),)
        made = second if share > 0.5 else first
        report.add(where, "a mixture of materials", f"the one with the greater share ({max(share, 1.0 - share):.2g})")
    for number in kept:
        for loss in lost[number].losses:
            report.add(loss.where, loss.what, loss.became, loss.picture)
    return made
