"""Textures of the canonical scene; conventions as in :mod:`scenes.canonical`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenes.canonical.values import Rgb, SceneError


@dataclass(frozen=True)
class ConstantTexture:
    """One colour everywhere."""

    value: Rgb


WHITE = ConstantTexture((1.0, 1.0, 1.0))


@dataclass(frozen=True, eq=False)
class ImageTexture:
    """An image that is looked up at ``uv * uv_scale + uv_offset``.

    Attributes:
        image: ``(height, width, 3)`` float32, linear RGB, row 0 at the top (``v = 1``).
        wrap: extension of the image outside ``[0, 1]``.
        filter: ``mipmap`` is bilinear within a level chosen by the ray's footprint.
        source: file of the image, for export and for messages.
    """

    image: NDArray[np.float32]
    uv_scale: tuple[float, float] = (1.0, 1.0)
    uv_offset: tuple[float, float] = (0.0, 0.0)
    wrap: Literal["repeat", "clamp", "black"] = "repeat"
    filter: Literal["nearest", "bilinear", "mipmap"] = "mipmap"
    source: str = ""

    def __post_init__(self) -> None:
        if self.image.ndim != 3 or self.image.shape[2] != 3 or min(self.image.shape[:2]) < 1:
            raise SceneError(f"ImageTexture {self.source!r}: expected (h, w, 3) with h, w >= 1, got {self.image.shape}")
        if not np.isfinite(self.image).all():
            raise SceneError(f"ImageTexture {self.source!r}: holds non-finite values")


@dataclass(frozen=True)
class CheckerboardTexture:
    """Two textures in alternating unit squares of ``uv * uv_scale``."""

    even: Texture
    odd: Texture
    uv_scale: tuple[float, float] = (1.0, 1.0)


@dataclass(frozen=True)
class ScaleTexture:
    """The product of two textures."""

    first: Texture
    second: Texture


@dataclass(frozen=True)
class MixTexture:
    """``(1 - amount) * first + amount * second``."""

    first: Texture
    second: Texture
    amount: float = 0.5


Texture = ConstantTexture | ImageTexture | CheckerboardTexture | ScaleTexture | MixTexture
