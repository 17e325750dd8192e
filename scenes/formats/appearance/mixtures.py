"""Mixtures of materials: dimmed metals are mixtures with black, and sums of lobes are mixtures of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from scenes.canonical import (
    Bumped,
    ConstantTexture,
    Emissive,
    Glass,
    Glossy,
    Masked,
    Material,
    Matte,
    Metal,
    MixMaterial,
    Plastic,
    Scene,
    Texture,
    Translucent,
    Uber,
)
from scenes.canonical.textures import WHITE
from scenes.formats.appearance.folding import folded, greatest_of, product_of
from scenes.formats.appearance.graphs import once_a_node, parts_of
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.losses import LossReport

BLACK = Matte(ConstantTexture(grey(0.0)))

NOTHING = Masked(BLACK, ConstantTexture(grey(0.0)))
"""An invisible surface, such as the border of a medium."""


def is_nothing(material: Material) -> bool:
    """Whether a surface is invisible."""
    return isinstance(material, Masked) and material.opacity == NOTHING.opacity


def lets_through(material: Material) -> bool:
    """Whether light goes straight through a surface, or through a part of it: holes and panes."""
    return once_a_node(_lets_through, material)


def _lets_through(part: Material | Texture, again: Callable[[Material | Texture], bool]) -> bool:
    if isinstance(part, Masked) or (isinstance(part, Glass) and part.thin):
        return True
    return any(again(inner) for inner in parts_of(part) if not isinstance(inner, Texture))


def direct_if_same(scene: Scene) -> Scene:
    """The scene with direct light of depth 1 in place of Whitted's method, or of greater depth, if nothing mirrors,
    refracts or has holes: rays of these go on from such surfaces alone, so the picture is the same."""
    whitted = scene.integrator.kind in ("whitted", "direct") and scene.integrator.depth != 0
    if not whitted or any(once_a_node(_has_sharp_parts, one.material) for one in scene.instances):
        return scene
    return dataclasses.replace(scene, integrator=dataclasses.replace(scene.integrator, kind="direct", depth=1))


def _has_sharp_parts(part: Material | Texture, again: Callable[[Material | Texture], bool]) -> bool:
    if isinstance(part, MixMaterial | Bumped):
        return any(again(inner) for inner in parts_of(part) if not isinstance(inner, Texture))
    if isinstance(part, Metal | Glossy):
        return min(part.roughness) == 0.0
    if isinstance(part, Plastic):
        return part.roughness == 0.0
    return not isinstance(part, Matte | Translucent | Emissive)


def mixture_of(first: Material, second: Material, amount: Texture) -> Material:
    """A mixture with the share ``amount`` of the second material; a metal mixed with black becomes a dimmed metal."""
    black = isinstance(first, Matte) and first.reflectance == BLACK.reflectance
    if black and isinstance(second, Metal) and second.reflectance_scale == WHITE:
        return dataclasses.replace(second, reflectance_scale=amount)
    return MixMaterial(first, second, amount)


def dimmed(material: Metal) -> MixMaterial:
    """A dimmed metal as a mixture with black: the inverse of :func:`mixture_of`."""
    bright = dataclasses.replace(material, reflectance_scale=WHITE)
    return MixMaterial(BLACK, bright, material.reflectance_scale)


def _scaled(texture: Texture, factor: float) -> Texture:
    return texture if factor == 1.0 else folded(product_of(texture, ConstantTexture(grey(factor))))


def _capped(texture: Texture, factor: float) -> Texture:
    """A texture times a factor, clamped to 1 if it is constant."""
    scaled = _scaled(texture, factor)
    return ConstantTexture(rgb(np.minimum(scaled.value, 1.0))) if isinstance(scaled, ConstantTexture) else scaled


def coat_share(material: Plastic) -> float:
    """The share of the coat in a mixture with the base, in [0.02, 1]. Neither must reflect more than the incident
    light; the base has priority."""
    room = 1.0 - greatest_of(material.diffuse)
    return float(np.clip(min(greatest_of(material.specular), room), 0.02, 1.0))


@dataclasses.dataclass(frozen=True)
class Lobe:
    """A part of a sum: a material, the attributes that hold its colours, and the greatest value of these."""

    material: Material
    colors: tuple[str, ...]
    greatest: float


def sum_of(lobes: list[Lobe], where: str, report: LossReport) -> Material:
    """A sum of lobes as a mixture: each is scaled by the inverse of its share, and the remainder is black.

    Lobes that together reflect more than the incident light are darkened, which is reported.
    """
    found = [lobe for lobe in lobes if lobe.greatest > 0.0]
    total = sum(lobe.greatest for lobe in found)
    if total > 1.0 + 1e-6:
        report.add(where, f"lobes that reflect {total:.3g} in total", "1")
    made, share = BLACK, max(1.0 - total, 0.0)
    for lobe in found:
        scaled = {name: _scaled(getattr(lobe.material, name), 1.0 / lobe.greatest) for name in lobe.colors}
        bright = dataclasses.replace(lobe.material, **scaled)
        share += lobe.greatest
        amount = lobe.greatest / share
        made = bright if amount > 1.0 - 1e-9 else MixMaterial(made, bright, ConstantTexture(grey(amount)))
    return made


def lobes_of(material: Uber, where: str, report: LossReport, schlick: bool = False) -> Material:
    """The parts of PBRT's uber, with its opacity: diffuse, glossy, mirrored and transmitted.

    Mirror and transmission together become glass. Glossy part and mirror follow Fresnel's equations as non-absorbing
    metals, or Schlick's approximation as coats over black.
    """

    def shiny(color: Texture, roughness: tuple[float, float]) -> Lobe:
        greatest = greatest_of(color)
        if schlick:
            straight = ((material.ior - 1.0) / (material.ior + 1.0)) ** 2
            alphas = max(roughness[0], 1e-3), max(roughness[1], 1e-3)
            return Lobe(Glossy(BLACK.reflectance, _scaled(color, straight), alphas), ("specular",), greatest)
        return Lobe(Metal(grey(material.ior), grey(0.0), roughness, color), ("reflectance_scale",), greatest)

    lobes = [Lobe(Matte(material.diffuse), ("reflectance",), greatest_of(material.diffuse))]
    lobes.append(shiny(material.specular, material.roughness))
    through = greatest_of(material.transmittance)
    if through > 0.0:
        clear = Glass(material.reflectance, material.transmittance, material.ior)
        lobes.append(Lobe(clear, ("reflectance", "transmittance"), max(greatest_of(material.reflectance), through)))
    else:
        lobes.append(shiny(material.reflectance, (0.0, 0.0)))
    made = sum_of(lobes, where, report)
    return made if material.opacity == WHITE else Masked(made, material.opacity)


def added_metal(material: Plastic, where: str, report: LossReport) -> Material:
    """A plastic whose coat is added to its base, as a mixture of the base with a non-absorbing metal.

    The Fresnel reflectance of such a metal is that of the coat. :func:`plastic_of` is the inverse.
    """
    if greatest_of(material.specular) == 0.0:
        return Matte(material.diffuse)
    share = coat_share(material)
    if greatest_of(material.specular) > share + 1e-6:
        report.add(where, "a coat and a base that reflect more than the incident light", "a darker coat")
    coat = _capped(material.specular, 1.0 / share)
    alphas = material.roughness, material.roughness
    metal = Metal(grey(material.ior), grey(0.0), alphas, coat, material.distribution, material.alpha)
    return MixMaterial(Matte(_scaled(material.diffuse, 1.0 / (1.0 - share))), metal, ConstantTexture(grey(share)))


def plastic_of(material: MixMaterial) -> Material:
    """The plastic that :func:`added_metal` turned into a mixture, or the mixture itself."""
    base, coat, amount = material.first, material.second, material.amount
    if not (isinstance(base, Matte) and isinstance(coat, Metal) and isinstance(amount, ConstantTexture)):
        return material
    share, even = amount.value[0], len(set(amount.value)) == len(set(coat.eta)) == len(set(coat.roughness)) == 1
    if not (even and base.sigma_deg == 0.0 and coat.k == grey(0.0) and coat.eta[0] > 1.0 and 0.0 < share < 1.0):
        return material
    parts = (
        product_of(base.reflectance, ConstantTexture(grey(1.0 - share))),
        product_of(coat.reflectance_scale, ConstantTexture(grey(share))),
    )
    alphas = {"distribution": coat.distribution, "alpha": coat.alpha}
    return Plastic(*parts, coat.eta[0], coat.roughness[0], layered=False, **alphas)  # type: ignore[arg-type]


def added_coat(material: Plastic) -> Material:
    """The same for LuxRender: a mixture of the base with a coat over black, which reflects by Schlick's
    approximation."""
    if greatest_of(material.specular) == 0.0:
        return Matte(material.diffuse)
    share, straight = coat_share(material), ((material.ior - 1.0) / (material.ior + 1.0)) ** 2
    alpha = max(material.roughness, 1e-3)
    coat = Glossy(BLACK.reflectance, _capped(material.specular, straight / share), (alpha, alpha), material.alpha)
    return MixMaterial(Matte(_scaled(material.diffuse, 1.0 / (1.0 - share))), coat, ConstantTexture(grey(share)))
