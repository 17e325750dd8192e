"""Materials of a glTF file for path tracing: textured metallic-roughness surfaces with normal maps, holes and emission.

All textures of a material must have the coordinates of its first one; others are left out, which is reported. Occlusion
maps are not needed, because path tracing computes the light between surfaces.

Source: Khronos Group, "glTF 2.0 specification", section 3.9 and appendix B; extensions KHR_materials_clearcoat,
KHR_materials_emissive_strength, KHR_materials_ior, KHR_materials_specular, KHR_materials_transmission,
KHR_materials_unlit, KHR_materials_volume.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from scenes.canonical import (
    ConstantTexture,
    Emissive,
    Glass,
    Masked,
    Material,
    Medium,
    MetallicRough,
    MixMaterial,
    NormalMapped,
    Texture,
)
from scenes.formats.appearance.attenuation import LEAST, medium_of
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.mixtures import NOTHING
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.losses import LossReport
from scenes.models.gltf_textures import Lookup, Textures, lookup_of
from scenes.models.phong_of_parts import scaled

ALONG_PATHS = {"KHR_materials_clearcoat", "KHR_materials_specular"}
"""Extensions that only this module reads."""

_BLACK = ConstantTexture((0.0, 0.0, 0.0))


def lookups_beside(given: dict[str, Any]) -> Iterator[tuple[str, Lookup]]:
    """The textures of a material except that of its colour, by name."""
    parts = given.get("pbrMetallicRoughness", {})
    for name, info in (
        ("metallicRoughnessTexture", parts.get("metallicRoughnessTexture")),
        ("normalTexture", given.get("normalTexture")),
        ("emissiveTexture", given.get("emissiveTexture")),
    ):
        lookup = lookup_of(info)
        if lookup is not None:
            yield name, lookup


class FacetMaterials:
    """Creates materials from the textures of one file."""

    def __init__(self, textures: Textures, report: LossReport) -> None:
        self.textures, self.report = textures, report

    def material(
        self, given: dict[str, Any], base: Texture, shared: Lookup | None, where: str, veil: Texture
    ) -> Material:
        """The material with the given properties.

        Args:
            given: properties from the file.
            base: base colour.
            shared: lookup of its textures; None if there are no coordinates.
            where: place for messages.
            veil: opacity of the vertices, an image only where there are no textures.
        """
        extensions, parts = given.get("extensions", {}), given.get("pbrMetallicRoughness", {})
        pictures = {name: self._alike(name, lookup, shared, where) for name, lookup in lookups_beside(given)}
        found: Material
        if "KHR_materials_unlit" in extensions:
            found = MetallicRough(_BLACK, 0.0, 1.0, ior=1.0, emission=(1.0, 1.0, 1.0), glow=base)
        else:
            coat = extensions.get("KHR_materials_clearcoat", {})
            for name in sorted(name for name in coat if name.endswith("Texture")):
                self.report.add(where, f"a texture of its clear coat ({name})")
            metallic, rough = (float(np.clip(parts.get(f"{name}Factor", 1.0), 0.0, 1.0)) for name in PARTS)
            beside, glow = pictures.get("metallicRoughnessTexture"), pictures.get("emissiveTexture")
            strength = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
            emission = np.asarray(given.get("emissiveFactor", (0.0, 0.0, 0.0)), np.float64) * strength
            found = MetallicRough(
                base,
                metallic,
                rough,
                None if beside is None else self._picture(beside, where, numbers=True),
                self._index(extensions, where),
                float(np.clip(coat.get("clearcoatFactor", 0.0), 0.0, 1.0)),
                float(np.clip(coat.get("clearcoatRoughnessFactor", 0.0), 0.0, 1.0)),
                rgb(np.maximum(emission, 0.0)),
                None if glow is None or not (emission > 0.0).any() else self._picture(glow, where),
            )
            shining = MetallicRough(_BLACK, 0.0, rough, ior=1.0, emission=found.emission)
            if given.get("doubleSided", False) and max(found.emission) > 0.0 and found == shining:
                found = Emissive(found.emission)
            elif _through(extensions):
                found = self._clear(given, found, where)
        normal = pictures.get("normalTexture")
        if normal is not None:
            scale = float(given["normalTexture"].get("scale", 1.0))
            found = NormalMapped(found, self._picture(normal, where, numbers=True), scale)
        return self._with_holes(given, found, shared, where, veil)

    def medium(self, given: dict[str, Any], where: str) -> Medium | None:
        """The medium within a surface that light passes, if it has a volume.

        Its border is the mesh, as for every path tracer: the thickness of the format, an estimate for renderers that
        do not follow light, tells only whether there is a volume.
        """
        extensions = given.get("extensions", {})
        volume = extensions.get("KHR_materials_volume", {})
        if not (_through(extensions) and volume.get("thicknessFactor", 0.0) > 0.0):
            return None
        color, distance = rgb(volume.get("attenuationColor", (1.0, 1.0, 1.0))), volume.get("attenuationDistance")
        if distance is not None and distance <= 0.0:
            self.report.add(where, f"an attenuation distance of {distance:g}", "no absorption")
        if not LEAST <= min(color) <= max(color) <= 1.0 and distance is not None:
            self.report.add(where, "a colour of absorption below 1e-08 or above 1", "the nearest between them")
        return None if distance is None else medium_of(color, distance)

    def _clear(self, given: dict[str, Any], solid: MetallicRough, where: str) -> Material:
        """A surface of which the part that is no metal lets light through, in whole or in part: a mixture with glass of
        the same facets."""
        extensions = given["extensions"]
        through = extensions["KHR_materials_transmission"]
        lookup = lookup_of(through.get("transmissionTexture"))
        share = _through(extensions)
        if lookup is not None:
            self.report.add(where, "a texture of the light that passes", "its mean")
            share *= float(self.textures.picture(lookup, numbers=True)[..., 0].mean(dtype=np.float64))
        metallic, roughness = solid.metallic, solid.roughness
        if solid.parts is not None:
            _, green, blue = mean_of(solid.parts)
            metallic, roughness = metallic * min(blue, 1.0), roughness * min(green, 1.0)
        share *= 1.0 - metallic
        if share <= 0.0:
            return solid
        if solid.parts is not None:
            self.report.add(where, "a texture of the roughness of glass", "its mean")
        if max(solid.emission) > 0.0:
            self.report.add(where, "light of a surface that lets light through")
        thin = not extensions.get("KHR_materials_volume", {}).get("thicknessFactor", 0.0) > 0.0
        if thin and roughness > 0.0:
            self.report.add(where, "a rough pane", "a clear one")
        if solid.coat > 0.0:
            self.report.add(where, "a clear coat on glass")
        alpha = 0.0 if thin else roughness**2
        glass = Glass(transmittance=solid.base, ior=solid.ior, roughness=(alpha, alpha), thin=thin)
        if share >= 1.0:
            unseen = glass == Glass(ior=1.0) and self.medium(given, where) is not None
            return NOTHING if unseen else glass
        rest = MetallicRough(solid.base, metallic / (1.0 - share), roughness, ior=solid.ior)
        return MixMaterial(rest, glass, ConstantTexture(grey(share)))

    def _index(self, extensions: dict[str, Any], where: str) -> float:
        """The refractive index; 1 for a dielectric without reflection (a specular factor of 0)."""
        specular = extensions.get("KHR_materials_specular", {})
        factor = float(specular.get("specularFactor", 1.0))
        if factor == 0.0:
            return 1.0
        if factor != 1.0 or specular.keys() - {"specularFactor"}:
            self.report.add(where, "KHR_materials_specular", "a reflection by the index alone")
        return max(float(extensions.get("KHR_materials_ior", {}).get("ior", 1.5)), 1.0)

    def _alike(self, name: str, lookup: Lookup, shared: Lookup | None, where: str) -> Lookup | None:
        if shared is not None and lookup.place == shared.place:
            return lookup
        self.report.add(where, f"{name}, whose coordinates differ from those of its other textures")
        return None

    def _picture(self, lookup: Lookup, where: str, numbers: bool = False) -> Texture:
        return self.textures.texture(lookup, self.textures.picture(lookup, numbers), where)

    def _with_holes(
        self, given: dict[str, Any], material: Material, shared: Lookup | None, where: str, veil: Texture
    ) -> Material:
        mode, parts = given.get("alphaMode", "OPAQUE"), given.get("pbrMetallicRoughness", {})
        if mode not in ("MASK", "BLEND"):
            return material
        factor = float(np.clip(parts.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))[3], 0.0, 1.0))
        cutoff = float(given.get("alphaCutoff", 0.5)) if mode == "MASK" else None
        if not isinstance(veil, ConstantTexture):
            return Masked(material, scaled(veil, factor), cutoff)
        factor *= min(max(veil.value[0], 0.0), 1.0)
        lookup = lookup_of(parts.get("baseColorTexture"))
        if lookup is None or shared is None:
            return Masked(material, ConstantTexture(rgb(np.full(3, factor))), cutoff) if factor < 1.0 else material
        opacity = self.textures.texture(lookup, self.textures.opacity(lookup) * np.float32(factor), where)
        return Masked(material, opacity, cutoff)


def _through(extensions: dict[str, Any]) -> float:
    """The share of the light that passes."""
    factor = extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0.0)
    return float(np.clip(factor, 0.0, 1.0))


PARTS = ("metallic", "roughness")
