"""Writer of materials and textures of a glTF file.

Source: Khronos Group, "glTF 2.0 specification", sections 3.8 and 3.9; extension KHR_texture_transform, and those of
:mod:`scenes.formats.appearance.surfaces`.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from scenes.canonical import ImageTexture, Material, Medium, Texture
from scenes.canonical.values import Rgb
from scenes.formats.appearance.attenuation import attenuation
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.normals import map_of
from scenes.formats.appearance.pictured import (
    as_file,
    factored,
    in_bytes,
    number_codes,
    placed_alike,
    srgb_codes,
    unmirrored,
)
from scenes.formats.appearance.spectra import rgb
from scenes.formats.appearance.surfaces import Surface, surface_of
from scenes.formats.gltf.document import Document, Json
from scenes.formats.losses import LossReport
from scenes.pictures import resized

_NEAREST, _LINEAR, _LINEAR_LEVELS = 9728, 9729, 9987
_WRAPS = {"repeat": 10497, "clamp": 33071, "black": 33071}


@dataclass(frozen=True, eq=False)
class Look:
    """What a material of glTF holds.

    Attributes:
        material: material of the surface.
        emission: radiance of a lamp with this material; None for that of the material.
        both_sides: whether it is the same on both sides; otherwise its back is not drawn.
        medium: medium within glass, which absorbs.
    """

    material: Material
    emission: Rgb | None
    both_sides: bool
    medium: Medium | None

    @property
    def key(self) -> tuple[object, ...]:
        """A key that is equal for equal looks."""
        return id(self.material), self.emission, self.both_sides, self.medium


@dataclass
class GltfMaterialWriter:
    """Writes materials, each once."""

    document: Document
    report: LossReport
    _surfaces: dict[int, tuple[Material, Surface]] = field(default_factory=dict)

    def material(self, look: Look, where: str) -> int:
        """The index of a material; ``where`` is its place for messages."""
        return self.document.once(("material", look.key), look, lambda: self._material(look, where))

    def _material(self, look: Look, where: str) -> int:
        surface = surface_of(look.material, where, self.report)
        rough: Json = {"metallicFactor": surface.metallic, "roughnessFactor": surface.roughness}
        made: Json = {"pbrMetallicRoughness": rough, "doubleSided": look.both_sides}
        self._base(surface, rough, made, where)
        if surface.parts is not None:
            factor, image = self._factored(surface.parts, where, "numbers")
            rough["roughnessFactor"] = min(surface.roughness * factor[1], 1.0)
            rough["metallicFactor"] = min(surface.metallic * factor[2], 1.0)
            if image is not None:
                rough["metallicRoughnessTexture"] = self._lookup(surface, image, "numbers")
        if surface.normals is not None:
            _, image = self._factored(map_of(surface.normals), where, "as it is")
            if image is None:
                self.report.add(where, "a normal map", "the normals of the shape")
            else:
                made["normalTexture"] = {**self._lookup(surface, image, "numbers"), "scale": surface.normal_scale}
        self._emission(surface, look.emission, made, where)
        self._extensions(surface, look.medium, made)
        return self.document.add("materials", made)

    def _base(self, surface: Surface, rough: Json, made: Json, where: str) -> None:
        """Writes the colour and the opacity, which share a picture."""
        factor, image = self._factored(surface.base, where)
        if max(factor) > 1.0:
            self.report.add(where, f"a colour of {max(factor):.3g}", "1")
        alpha, holes = 1.0, None
        if surface.opacity is not None:
            alpha, holes = self._opacity(surface.opacity, where)
            made["alphaMode"] = "BLEND" if surface.cutoff is None else "MASK"
            if surface.cutoff is not None:
                made["alphaCutoff"] = surface.cutoff
        if image is not None and holes is not None and not placed_alike(image, holes):
            self.report.add(where, "holes that lie otherwise than the colours", "their mean")
            alpha, holes = alpha * mean_of(holes)[0], None
        rough["baseColorFactor"] = [min(max(float(part), 0.0), 1.0) for part in (*factor, alpha)]
        if holes is not None:
            rough["baseColorTexture"] = self._lookup(surface, image or holes, "colour", holes, image is None)
        elif image is not None:
            rough["baseColorTexture"] = self._lookup(surface, image, "colour")

    def _opacity(self, opacity: Texture, where: str) -> tuple[float, ImageTexture | None]:
        """An opacity as a number times an image with equal channels, those of colours being their means."""
        factor, image = self._factored(opacity, where, "numbers")
        values = np.array(factor) if image is None else image.image * np.array(factor)
        if not np.ptp(values, axis=-1).any():
            return factor[0], image
        self.report.add(where, "a coloured opacity", "the mean of its channels")
        means = np.repeat(values.mean(axis=-1, keepdims=True), 3, axis=-1)
        if image is None:
            return float(means[0]), None
        most = np.maximum(means.reshape(-1, 3).max(axis=0), 0.0)
        even = dataclasses.replace(image, image=means.astype(np.float32))
        made = self.document.once(("opacity", id(image), factor), image, lambda: _divided(even, most))
        return float(most[0]), made

    def _emission(self, surface: Surface, emission: Rgb | None, made: Json, where: str) -> None:
        radiance, glow = surface.emission, surface.glow
        if emission is not None:
            if max(radiance) > 0.0:
                self.report.add(where, "a lamp of a material that shines", "the lamp")
            radiance, glow = emission, None
        if max(radiance) <= 0.0:
            return
        if glow is not None:
            factor, image = self._factored(glow, where)
            radiance = rgb(np.multiply(radiance, factor))
            if image is not None:
                made["emissiveTexture"] = self._lookup(surface, image, "colour")
        strength = max(1.0, *radiance)
        made["emissiveFactor"] = [part / strength for part in radiance]
        if strength > 1.0:
            self._add(made, "emissive_strength", {"emissiveStrength": strength})

    def _extensions(self, surface: Surface, medium: Medium | None, made: Json) -> None:
        if surface.transmitted:
            self._add(made, "transmission", {"transmissionFactor": 1.0})
            if surface.thick:
                self._add(made, "volume", {"thicknessFactor": 1.0, **({} if medium is None else attenuation(medium))})
        if surface.ior != 1.5:
            self._add(made, "ior", {"ior": surface.ior})
        if surface.specular != 1.0:
            self._add(made, "specular", {"specularFactor": surface.specular})
        if surface.coat > 0.0:
            coat = {"clearcoatFactor": surface.coat, "clearcoatRoughnessFactor": surface.coat_roughness}
            self._add(made, "clearcoat", coat)

    def _add(self, made: Json, name: str, values: Json) -> None:
        made.setdefault("extensions", {}).update(self.document.extension(f"KHR_materials_{name}", values))

    def _factored(self, texture: Texture, where: str, mode: str = "colour") -> tuple[Rgb, ImageTexture | None]:
        """A texture as a colour times an image of values up to 1, or the colour alone; others become their mean.

        Images that 8 bits do not hold are divided by their greatest values, so that what 8 bits come to is the same
        again. The mode is ``colour``, ``numbers`` (which are not encoded), or ``as it is``.
        """
        factor, image = factored(texture, where, self.report)
        if image is None:
            return factor, None
        if image.wrap == "black":
            self.report.add(where, "a picture that is black beyond its border", "the colours of its border")
        if mode == "as it is" or in_bytes(image.image, mode == "numbers"):
            return factor, image
        self.report.hint(where, "a picture of more than 8 bits", "8 bits")
        most = np.maximum(image.image.reshape(-1, 3).max(axis=0), 0.0)
        made = self.document.once(("scaled", id(image)), image, lambda: _divided(image, most))
        return rgb(np.multiply(factor, most)), made

    def _lookup(
        self, surface: Surface, texture: ImageTexture, mode: str, holes: ImageTexture | None = None, white: bool = False
    ) -> Json:
        """The reference of a surface to a texture, with its transform; ``v`` points downwards in glTF.

        A transform that mirrors would turn the normals of a normal map: beside one, the pictures are mirrored instead.
        """
        if surface.normals is not None:
            texture, holes = self._unmirrored(texture), None if holes is None else self._unmirrored(holes)
        filters = (_NEAREST, _NEAREST) if texture.filter == "nearest" else (_LINEAR, _LINEAR_LEVELS)
        wrap = _WRAPS[texture.wrap]
        sampler = self.document.once(
            ("sampler", filters, wrap),
            None,
            lambda: self.document.add(
                "samplers", {"magFilter": filters[0], "minFilter": filters[1], "wrapS": wrap, "wrapT": wrap}
            ),
        )
        kept = texture.image, None if holes is None else holes.image
        source = self.document.once(
            ("image", id(kept[0]), id(kept[1]), mode, white), kept, lambda: self._image(texture, mode, holes, white)
        )
        index = self.document.once(
            ("texture", source, sampler),
            None,
            lambda: self.document.add("textures", {"source": source, "sampler": sampler}),
        )
        found: Json = {"index": index}
        (across, up), (right, above) = texture.uv_scale, texture.uv_offset
        if (texture.uv_scale, texture.uv_offset) != ((1.0, 1.0), (0.0, 0.0)):
            change = {"scale": [across, up], "offset": [right, 1.0 - up - above]}
            found["extensions"] = self.document.extension("KHR_texture_transform", change)
        return found

    def _unmirrored(self, texture: ImageTexture) -> ImageTexture:
        """The same texture with positive scales, by a mirrored picture where they are not."""
        if min(texture.uv_scale) >= 0.0:
            return texture
        return self.document.once(("mirrored", id(texture)), texture, lambda: unmirrored(texture))

    def _image(self, texture: ImageTexture, mode: str, holes: ImageTexture | None, white: bool) -> int:
        path = Path(texture.source)
        stem = path.stem or "picture"
        content = as_file(texture) if mode == "colour" and holes is None else None
        if content is not None:
            return self.document.image(content, stem, path.suffix.lower().replace(".jpeg", ".jpg"))
        codes = number_codes(texture.image) if mode == "numbers" else srgb_codes(texture.image)
        if holes is not None:
            opacity = number_codes(resized(holes.image[..., :1], *texture.image.shape[:2]))
            codes = np.full_like(codes, 255) if white else codes
            codes = np.concatenate([codes, opacity], axis=2)
        return self.document.picture(codes, stem)


def _divided(texture: ImageTexture, most: np.ndarray) -> ImageTexture:
    image = (np.maximum(texture.image, 0.0) / np.where(most > 0.0, most, 1.0)).astype(np.float32)
    return ImageTexture(image, texture.uv_scale, texture.uv_offset, texture.wrap, texture.filter, texture.source)
