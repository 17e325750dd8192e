"""Textures of a USD file, as those of a glTF file.

Source: OpenUSD documentation, UsdPreviewSurface specification (UsdUVTexture, UsdTransform2d).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import numpy as np
from PIL import Image

from scenes.canonical import SceneError
from scenes.formats.losses import LossReport
from scenes.loading import decode_srgb, fractions, rec709, state_of
from scenes.models.gltf_textures import BORDER, Lookup, Textures
from scenes.models.sources import Sources
from scenes.models.usd_library import Ar
from scenes.pictures import Pixels, alpha_of, decoded

WRAPS = {"repeat": 10497, "mirror": 33648, "clamp": 33071, "black": BORDER}
"""Modes of UsdUVTexture, and their numbers of a glTF sampler."""

_CHANNELS = {"r": 0, "g": 1, "b": 2}
Make = Callable[[], Pixels]


@dataclass(frozen=True)
class Reading:
    """One reading of a picture: ``texel * scale + bias`` of some of its channels.

    Attributes:
        path: resolved path, which may lie in a package.
        channels: ``rgb``, or one of ``r``, ``g``, ``b`` and ``a``.
        space: ``raw``, ``sRGB`` or ``auto``.
        scale, bias: of red, green, blue and alpha.
        place: key that is equal for readings at the same coordinates.
    """

    path: str
    channels: str
    space: str
    scale: tuple[float, ...]
    bias: tuple[float, ...]
    place: tuple[Any, ...]


class Pictures:
    """Pictures of a stage, each read once."""

    def __init__(self, sources: Sources) -> None:
        self.sources = sources
        self._colors: dict[tuple[str, str], Pixels] = {}
        self._opacities: dict[str, Pixels] = {}

    def values(self, reading: Reading) -> Pixels:
        """Values ``(h, w, 3)``; those of one channel three times.

        Raises:
            SceneError: the picture is missing, or cannot be read.
        """
        if reading.channels == "a":
            found = self._opacity(reading.path) * reading.scale[3] + reading.bias[3]
            return np.repeat(found[..., None], 3, axis=-1).astype(np.float32)
        scale, bias = (np.array(part[:3], np.float32) for part in (reading.scale, reading.bias))
        found = self._color(reading.path, reading.space) * scale + bias
        if reading.channels in _CHANNELS:
            at = _CHANNELS[reading.channels]
            found = np.repeat(found[..., at : at + 1], 3, axis=-1)
        return found

    def _color(self, path: str, space: str) -> Pixels:
        if (path, space) not in self._colors:
            given = self._read(path, decoded if space == "raw" else _colors)
            if given.dtype == np.float32 and space == "sRGB":
                given = np.rint(np.clip(given, 0.0, 1.0) * 65535.0).astype(np.uint16)
            raw = space == "raw" or (space != "sRGB" and not self._is_encoded(path, given))
            found = fractions(given) if raw or given.dtype == np.float32 else decode_srgb(given)
            if not np.isfinite(found).all():
                raise SceneError(f"texture {path}: holds non-finite values")
            self._colors[path, space] = found
        return self._colors[path, space]

    def _is_encoded(self, path: str, given: np.ndarray) -> bool:
        """True if a picture of no given space is sRGB: one of 8 bits with 3 or 4 channels, or one that says so."""
        return given.dtype == np.uint8 and self._read(path, _is_color)

    def _opacity(self, path: str) -> Pixels:
        if path not in self._opacities:
            self._opacities[path] = self._read(path, alpha_of)
        return self._opacities[path]

    def _read(self, path: str, of_file: Callable[[Path], Any]) -> Any:
        try:
            if not path.endswith("]"):
                self.sources.files.setdefault(Path(path), state_of(Path(path)))
                return of_file(Path(path))
            asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
            with TemporaryDirectory() as folder:  # decoders of more than 8 bits need a file
                unpacked = Path(folder) / f"picture{Path(path[:-1]).suffix}"
                unpacked.write_bytes(bytes(asset.GetBuffer()))
                return of_file(unpacked)
        except Exception as error:  # decoders raise arbitrary exceptions on broken files
            raise SceneError(f"texture {path}: cannot be read: {' '.join(str(error).split())}") from None


def _colors(path: Path) -> np.ndarray:
    given = decoded(path)
    return rec709(cast(Pixels, given), path) if given.dtype == np.float32 else given


def _is_color(path: Path) -> bool:
    with Image.open(path) as image:
        return "srgb" in image.info or image.mode not in ("1", "L", "LA", "La")


class UsdDocument:
    """Materials of a stage as those of a glTF file: the same names and properties.

    Attributes:
        materials: properties, as in the JSON of glTF.
        textures: for each texture how to make its values and its opacity, and its wrap modes.
    """

    def __init__(self, sources: Sources) -> None:
        self.sources = sources
        self.materials: list[dict[str, Any]] = []
        self.textures: list[tuple[Make, Make | None, tuple[int, int]]] = []

    def at(self, name: str, index: Any) -> dict[str, Any]:
        """An object of a list of the file."""
        if name == "materials":
            return self.materials[index]
        if name == "samplers":
            wraps = self.textures[index][2]
            return {"wrapS": wraps[0], "wrapT": wraps[1]}
        return {"sampler": index}


class UsdTextures(Textures):
    """Textures of the materials of a stage."""

    def __init__(self, document: UsdDocument, report: LossReport) -> None:
        super().__init__(document, report)
        self._made = document.textures
        self._pictures: dict[int, Pixels] = {}

    def picture(self, lookup: Lookup, numbers: bool = False) -> Pixels:
        if lookup.texture not in self._pictures:
            self._pictures[lookup.texture] = self._made[lookup.texture][0]()
        return self._pictures[lookup.texture]

    def opacity(self, lookup: Lookup) -> Pixels:
        make = self._made[lookup.texture][1]
        return np.ones((1, 1, 3), np.float32) if make is None else make()
