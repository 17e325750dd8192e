"""Materials of a glTF file as Phong materials, from factors and textures.

The base colour is the product of factor, texture and vertex colours, all linear. The diffuse colour is the non-metallic
share of the base colour, texel by texel. The highlight comes from the means of base colour, metallic share and
roughness (:func:`scenes.models.phong_of_parts.metallic_rough`).

Source: Khronos Group, "glTF 2.0 specification", section 3.9; extensions KHR_materials_emissive_strength,
KHR_materials_ior, KHR_materials_transmission, KHR_materials_unlit, KHR_materials_volume.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from scenes.canonical import ConstantTexture, Emissive, Glass, Material, Medium, Phong, Texture
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.spectra import rgb
from scenes.formats.losses import LossReport
from scenes.models.gltf_facets import ALONG_PATHS, PARTS, FacetMaterials, lookups_beside
from scenes.models.gltf_textures import Document, Lookup, Textures, Uvs, lookup_of, multiplied
from scenes.models.json_records import described
from scenes.models.phong_of_parts import diffuse_share, glowing, metallic_rough, scaled, seen_through
from scenes.models.vertex_colours import coloured_and_covered

_USED = {"KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_transmission", "KHR_materials_unlit",
         "KHR_materials_volume"}  # fmt: skip
_EVERYWHERE = Lookup(-1)
_WHITE = ConstantTexture((1.0, 1.0, 1.0))


@dataclass(frozen=True)
class Painted:
    """A material of triangles.

    Attributes:
        material: material of all triangles.
        uvs: texture coordinates of their corners; None without texture.
        baked: whether the texture holds the colours of the corners, so that each triangle has its own coordinates.
        medium: medium within glass, for path tracing.
    """

    material: Material
    uvs: Float[NDArray[np.float32], "f 3 2"] | None
    baked: bool = False
    medium: Medium | None = None


class GltfMaterials:
    """Materials of a file; for meshes without vertex colours each is created once."""

    def __init__(self, data: Document, textures: Textures, report: LossReport, facets: bool = False) -> None:
        """Materials are read on demand; with ``facets`` they are converted for path tracing
        (:mod:`scenes.models.gltf_facets`)."""
        self.data, self.report = data, report
        self.textures = textures
        self._facets = FacetMaterials(textures, report) if facets else None
        self._made: dict[int, Material] = {}

    def painted(
        self, number: int | None, sets: dict[int, Uvs], colors: Float[NDArray[np.float64], "f 3 channels"] | None
    ) -> Painted:
        """The material of a primitive.

        Args:
            number: index of the material; None for the default one.
            sets: texture coordinates ``(f, 3, 2)`` of the corners, by the index of their set.
            colors: linear colours of the corners, with or without an opacity.
        """
        given = {} if number is None else self.data.at("materials", number)
        where = f"material {given.get('name', number)}" if given else "the default material"
        given = self._without_missing(given, where)
        lookup = lookup_of(_rough(given).get("baseColorTexture"))
        if lookup is not None and lookup.coordinates not in sets:
            self.report.add(where, "a texture on a part without its texture coordinates")
            lookup = None
        uvs = None
        tint: Texture | None = None
        veil: Texture = _WHITE
        if colors is not None and given.get("alphaMode") not in ("MASK", "BLEND"):
            colors = colors[..., :3]
        if colors is not None and lookup is None:
            factor = np.append(_factor(given, "baseColorFactor"), 1.0)[: colors.shape[2]]
            tint, veil, uvs = coloured_and_covered(colors * factor, str(self.data.sources.path))
        elif colors is not None:
            mean = np.append(colors.reshape(-1, colors.shape[2]).mean(axis=0), 1.0)
            if (colors != 1.0).any():
                self.report.add(where, "vertex colours in addition to a texture", "their mean times the texture")
            tint, veil = ConstantTexture(rgb(mean[:3])), ConstantTexture(rgb(mean[[3, 3, 3]]))
        shared = lookup
        if self._facets is not None and lookup is None and uvs is None:
            shared = next((one for _, one in lookups_beside(given) if one.coordinates in sets), None)
        if shared is not None:
            uvs = shared.moved(sets[shared.coordinates]).astype(np.float32)
        medium = None if self._facets is None else self._facets.medium(given, where)
        if tint is not None:
            made = self._material(given, where, lookup, tint, shared, veil)
            return Painted(made, uvs, shared is None and uvs is not None, medium)
        key = -1 if number is None else number
        if key not in self._made or (lookup is None) != (lookup_of(_rough(given).get("baseColorTexture")) is None):
            self._made[key] = self._material(given, where, lookup, None, shared, veil)
        return Painted(self._made[key], uvs, medium=medium)

    def _without_missing(self, given: dict[str, Any], where: str) -> dict[str, Any]:
        """A material without the textures whose pictures are missing, and without emission where its texture is."""
        changed = copy.deepcopy(given)
        rough, through = _rough(changed), changed.get("extensions", {}).get("KHR_materials_transmission", {})
        parts = [(rough, "baseColorTexture"), (rough, "metallicRoughnessTexture"), (changed, "emissiveTexture")]
        along_paths = [(changed, "normalTexture"), (through, "transmissionTexture")]
        for part, name in (*parts, *(along_paths if self._facets else [])):
            lookup = lookup_of(part.get(name))
            missing = "" if lookup is None else self.textures.missing(lookup)
            if missing:
                shines = name == "emissiveTexture"
                became = "no emission" if shines else "left out"
                self.report.add(where, f"the picture {missing!r}, which is missing", became)
                del part[name]
                if shines:
                    changed["emissiveFactor"] = [0.0, 0.0, 0.0]
        return changed

    def _material(
        self,
        given: dict[str, Any],
        where: str,
        lookup: Lookup | None,
        tint: Texture | None,
        shared: Lookup | None,
        veil: Texture,
    ) -> Material:
        extensions = given.get("extensions", {})
        if given.get("alphaMode", "OPAQUE") not in ("OPAQUE", "MASK", "BLEND"):
            self.report.add(where, f"an opacity of mode {described(given['alphaMode'])}", "opaque")
        for name in sorted(extensions.keys() - (_USED | (ALONG_PATHS if self._facets else set()))):
            self.report.add(where, name)
        for name in () if self._facets else ("normalTexture", "occlusionTexture"):
            if name in given:
                self.report.add(where, name)
        base = self._base(given, where, lookup, tint)
        if self._facets is not None:
            return self._facets.material(given, base, shared, where, veil)
        if "KHR_materials_unlit" in extensions:
            if isinstance(base, ConstantTexture):
                return Emissive(base.value)
            self.report.add(where, "a surface without lighting", "a diffuse one")
            return Phong(base)
        through = extensions.get("KHR_materials_transmission", {})
        metallic = float(np.clip(_rough(given).get("metallicFactor", 1.0), 0.0, 1.0))
        share = float(np.clip(through.get("transmissionFactor", 0.0), 0.0, 1.0)) * (1.0 - metallic)
        if 0.0 < share < 1.0 or (share > 0.0 and "transmissionTexture" in through):
            self.report.add(where, "light that passes in part", "glass" if share > 0.5 else "an opaque surface")
        if share > 0.5:
            return self._glass(given, base, extensions, where)
        material = self._rough(given, base, where, lookup)
        mode = given.get("alphaMode", "OPAQUE")
        solid: Material = material
        if mode == "BLEND" and lookup is None and isinstance(veil, ConstantTexture):
            alpha = _rough(given).get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))[3] * veil.value[0]
            solid = seen_through(material, float(alpha), where, self.report)
        elif mode in ("BLEND", "MASK"):
            self.report.add(where, f"opacity in its texture ({mode})", "opaque")
        return self._glowing(given, solid, where)

    def _base(self, given: dict[str, Any], where: str, lookup: Lookup | None, tint: Texture | None) -> Texture:
        if lookup is None:
            return tint or ConstantTexture(rgb(_factor(given, "baseColorFactor")))
        factor = _factor(given, "baseColorFactor") * (1.0 if tint is None else mean_of(tint))
        image = self.textures.picture(lookup)
        if (factor != 1.0).any():
            image = image * factor.astype(np.float32)
        return self.textures.texture(lookup, image, where)

    def _rough(self, given: dict[str, Any], base: Texture, where: str, lookup: Lookup | None) -> Phong:
        """A Phong material; the metallic share and the roughness are the factors times the blue and green channels of
        their texture."""
        parts = _rough(given)
        metallic, roughness = (float(np.clip(parts.get(f"{name}Factor", 1.0), 0.0, 1.0)) for name in PARTS)
        beside = lookup_of(parts.get("metallicRoughnessTexture"))
        diffuse = None
        if beside is not None:
            numbers = np.clip(self.textures.picture(beside, numbers=True), 0.0, 1.0)
            if np.ptp(numbers[..., 1]) > 0.0:
                self.report.add(where, "a texture of the roughness", "its mean")
            roughness = float(roughness * numbers[..., 1].mean(dtype=np.float64))
            share = 1.0 - metallic * numbers[..., 2:3] * (1.0 - diffuse_share(1.0, roughness))
            metallic = float(metallic * numbers[..., 2].mean(dtype=np.float64))
            if np.ptp(share) > 0.0:
                if lookup is not None and beside.place == lookup.place:
                    image = multiplied(self.textures.picture(lookup), np.repeat(share.astype(np.float32), 3, axis=-1))
                    factor = _factor(given, "baseColorFactor").astype(np.float32)
                    diffuse = self.textures.texture(lookup, image * factor, where)
                else:
                    self.report.add(where, "a texture of the metallic share", "its mean")
        if diffuse is None:
            diffuse = scaled(base, diffuse_share(metallic, roughness))
        return metallic_rough(base, diffuse, metallic, roughness)

    def _glass(self, given: dict[str, Any], base: Texture, extensions: dict[str, Any], where: str) -> Material:
        """Clear glass of the mean base colour, thin unless it has a volume."""
        volume = extensions.get("KHR_materials_volume", {})
        if any(part != 1.0 for part in volume.get("attenuationColor", ())):
            self.report.add(where, "absorption in glass")
        ior = float(extensions.get("KHR_materials_ior", {}).get("ior", 1.5))
        if not isinstance(base, ConstantTexture):
            self.report.add(where, "a texture of glass", "its mean")
        color = ConstantTexture(rgb(np.clip(mean_of(base), 0.0, 1.0)))
        return Glass(transmittance=color, ior=max(ior, 1.0), thin=not volume.get("thicknessFactor", 0.0) > 0.0)

    def _glowing(self, given: dict[str, Any], material: Material, where: str) -> Material:
        strength = given.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        emission = np.asarray(given.get("emissiveFactor", (0.0, 0.0, 0.0)), np.float64) * strength
        if "emissiveTexture" in given and (emission > 0.0).any():
            lookup = lookup_of(given["emissiveTexture"])
            picture = self.textures.picture(lookup or _EVERYWHERE)
            if np.ptp(picture.reshape(-1, 3), axis=0).max() > 0.0:
                self.report.add(where, "a texture of the emission")
                return material
            emission = emission * picture[0, 0]
        return glowing(material, rgb(np.maximum(emission, 0.0)), where, self.report)


def _rough(given: dict[str, Any]) -> dict[str, Any]:
    return given.get("pbrMetallicRoughness", {})


def _factor(given: dict[str, Any], name: str) -> Float[NDArray[np.float64], " 3"]:
    return np.asarray(_rough(given).get(name, (1.0, 1.0, 1.0, 1.0))[:3], np.float64)
