"""Textures of a glTF file.

Source: Khronos Group, "glTF 2.0 specification", sections 3.8 (textures, samplers) and the extension
KHR_texture_transform.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Literal, Protocol, TypeVar

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray
from PIL import UnidentifiedImageError

from scenes.arithmetic import cos, sin
from scenes.canonical import ImageTexture
from scenes.formats.losses import LossReport
from scenes.loading import decode_srgb, fractions, one_line
from scenes.models.gltf_data import GltfData
from scenes.models.json_records import misplaced
from scenes.models.sources import Sources
from scenes.pictures import Pixels, alpha_of, decoded, resized

Values = TypeVar("Values")
Uvs = Float[NDArray[np.float64], "*n 2"]
_NEAREST, _CLAMP, _MIRRORED, _REPEAT = 9728, 33071, 33648, 10497
BORDER = 33069  # black outside; not a mode of glTF


@dataclass(frozen=True)
class Lookup:
    """Lookup of a texture.

    Attributes:
        texture: index of the texture.
        coordinates: index of the set of texture coordinates.
        offset, rotation_rad, scale: transform of the coordinates.
    """

    texture: int
    coordinates: int = 0
    offset: tuple[float, float] = (0.0, 0.0)
    rotation_rad: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    @property
    def place(self) -> tuple[Any, ...]:
        """A key that is equal for textures with the same lookup of coordinates."""
        return self.coordinates, self.offset, self.rotation_rad, self.scale

    def moved(self, uvs: Uvs) -> Uvs:
        """Converts coordinates of the file, with ``v`` downwards, to canonical ones, with ``v`` upwards.

        They are scaled, rotated counter-clockwise as seen on the image, and translated.
        """
        u, v = uvs[..., 0] * self.scale[0], uvs[..., 1] * self.scale[1]
        along, across = cos(self.rotation_rad), sin(self.rotation_rad)
        u, v = along * u + across * v, along * v - across * u
        return np.stack([u + self.offset[0], 1.0 - (v + self.offset[1])], axis=-1)


def lookup_of(info: dict[str, Any] | None) -> Lookup | None:
    """The lookup of a texture reference in a material; None if there is none."""
    if info is None or "index" not in info:
        return None
    change = info.get("extensions", {}).get("KHR_texture_transform", {})
    offset, scale = change.get("offset", (0.0, 0.0)), change.get("scale", (1.0, 1.0))
    return Lookup(
        info["index"],
        int(change.get("texCoord", info.get("texCoord", 0))),
        (float(offset[0]), float(offset[1])),
        float(change.get("rotation", 0.0)),
        (float(scale[0]), float(scale[1])),
    )


class Document(Protocol):
    """A file with materials in the terms of glTF."""

    sources: Sources

    def at(self, name: str, index: Any) -> dict[str, Any]:
        """An object of a top-level list."""
        ...


class Textures(ABC):
    """Images and samplers of a file; each image is read once."""

    def __init__(self, document: Document, report: LossReport) -> None:
        self.document, self.report = document, report

    @abstractmethod
    def picture(self, lookup: Lookup, numbers: bool = False) -> Pixels:
        """Texels ``(h, w, 3)`` of a texture: linear colours, or raw values with ``numbers``."""

    def missing(self, lookup: Lookup) -> str:
        """The name of the picture of a texture if there is no such file; empty if there is."""
        return ""

    @abstractmethod
    def opacity(self, lookup: Lookup) -> Pixels:
        """Texels ``(h, w, 3)`` of the opacity of a texture; 1 if it has none."""

    def texture(self, lookup: Lookup, image: Pixels, where: str) -> ImageTexture:
        """A texture of these texels, with the sampler of the file."""
        sampler = self._sampler(lookup)
        wraps = sampler.get("wrapS", _REPEAT), sampler.get("wrapT", _REPEAT)
        scale, offset = [1.0, 1.0], [0.0, 0.0]
        for axis, wrap in enumerate(wraps):
            if wrap == _MIRRORED:  # twice as large, with the second half mirrored
                along = 1 - axis
                image = np.concatenate([image, np.flip(image, along)], axis=along)
                scale[axis] = 0.5
                offset[axis] = 0.5 * axis  # the first half of rows is the upper one
        kinds = {wrap if wrap in (_CLAMP, BORDER) else _REPEAT for wrap in wraps}
        if len(kinds) > 1:
            self.report.add(where, "a texture clamped along one axis and repeated along the other", "one that repeats")
        wrap: Literal["clamp", "black", "repeat"] = "repeat"
        if len(kinds) == 1 and wraps[0] in (_CLAMP, BORDER):
            wrap = "clamp" if wraps[0] == _CLAMP else "black"
        kind: Literal["nearest", "mipmap"] = "nearest" if sampler.get("magFilter") == _NEAREST else "mipmap"
        image.flags.writeable = False
        source = str(self.document.sources.path)
        return ImageTexture(image, (scale[0], scale[1]), (offset[0], offset[1]), wrap, kind, source)

    def _sampler(self, lookup: Lookup) -> dict[str, Any]:
        texture = self.document.at("textures", lookup.texture)
        return self.document.at("samplers", texture["sampler"]) if "sampler" in texture else {}


class GltfTextures(Textures):
    """Images of a glTF file."""

    def __init__(self, data: GltfData, report: LossReport) -> None:
        super().__init__(data, report)
        self.data = data
        self._pictures: dict[tuple[int, bool], Pixels] = {}
        self._opacities: dict[int, Pixels] = {}

    def picture(self, lookup: Lookup, numbers: bool = False) -> Pixels:
        source = self._source(lookup)
        key = (source, numbers)
        if key not in self._pictures:
            found = self._decoded(source, decoded)
            linear = numbers or found.dtype == np.float32
            self._pictures[key] = fractions(found) if linear else decode_srgb(found)  # type: ignore[arg-type]
        return self._pictures[key]

    def opacity(self, lookup: Lookup) -> Pixels:
        source = self._source(lookup)
        if source not in self._opacities:
            found = self._decoded(source, alpha_of)
            self._opacities[source] = np.repeat(found[..., None], 3, axis=-1)
        return self._opacities[source]

    def missing(self, lookup: Lookup) -> str:
        name = self.data.image_file(self._source(lookup))
        return name if name and self.data.sources.find(name) is None else ""

    def _source(self, lookup: Lookup) -> int:
        texture = self.data.at("textures", lookup.texture)
        source = texture.get("source", texture.get("extensions", {}).get("EXT_texture_webp", {}).get("source"))
        if source is None:
            raise misplaced(f"textures[{lookup.texture}].source", "an index of images", "none")
        return source

    def _decoded(self, source: int, read: Callable[[Path | BinaryIO], Values]) -> Values:
        """What a decoder makes of an image.

        Raises:
            SceneError: there is no such file, or it cannot be decoded.
        """
        name, content = self.data.image_bytes(source)
        file = self.data.sources.require(name, "a texture at") if content is None else content
        try:
            return read(file)
        except Exception as error:  # decoders raise arbitrary exceptions on broken files
            why = "embedded data that is none" if isinstance(error, UnidentifiedImageError) else one_line(error)
            raise misplaced(f"images[{source}]", "an image", why) from None


def multiplied(first: Pixels, second: Pixels) -> Pixels:
    """The product of two images, with the larger number of texels along each axis."""
    height, width = (max(first.shape[axis], second.shape[axis]) for axis in (0, 1))
    return resized(first, height, width) * resized(second, height, width)
