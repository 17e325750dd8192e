"""Textures as a colour times a picture, for formats that have no other ones, and their pictures of 8 bits."""

from __future__ import annotations

from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8
from numpy.typing import NDArray

from scenes.canonical import CheckerboardTexture, ConstantTexture, ImageTexture, Rgb, ScaleTexture, Texture
from scenes.formats.appearance.folding import folded, mean_of
from scenes.formats.appearance.spectra import rgb
from scenes.formats.losses import LossReport
from scenes.loading import decode_srgb, read_image

_WHOLE = (1.0, 1.0, 1.0)
_FILES = (".png", ".jpg", ".jpeg")


def factored(texture: Texture, where: str, report: LossReport) -> tuple[Rgb, ImageTexture | None]:
    """A texture as a colour times a picture, or the colour alone; what is neither becomes its mean, which is
    reported."""
    if isinstance(texture, ConstantTexture):
        return texture.value, None
    if isinstance(texture, ScaleTexture):
        for one, other in ((texture.first, texture.second), (texture.second, texture.first)):
            if isinstance(one, ConstantTexture):
                factor, image = factored(other, where, report)
                return rgb(np.multiply(factor, one.value)), image
    if isinstance(texture, CheckerboardTexture):
        texture = _checks(texture) or texture
    if isinstance(texture, ImageTexture):
        return _WHOLE, texture
    plain = folded(texture)
    if type(plain) is not type(texture):
        return factored(plain, where, report)
    report.add(where, f"texture {type(texture).__name__}", "its mean")
    return mean_of(texture), None


def _checks(texture: CheckerboardTexture) -> ImageTexture | None:
    """Four texels that repeat, in place of squares of two colours; None if they are not plain."""
    if not (isinstance(texture.even, ConstantTexture) and isinstance(texture.odd, ConstantTexture)):
        return None
    return _four_texels(texture.even.value, texture.odd.value, *texture.uv_scale)


@lru_cache(maxsize=256)
def _four_texels(even: Rgb, odd: Rgb, across: float, down: float) -> ImageTexture:
    """Equal ones are one picture, which writers then store once."""
    image = np.array([[odd, even], [even, odd]], np.float32)
    return ImageTexture(image, (0.5 * across, 0.5 * down), (0.0, 0.0), "repeat", "nearest")


def placed_alike(first: ImageTexture, second: ImageTexture) -> bool:
    """Whether two pictures lie in the same way."""
    return (first.uv_scale, first.uv_offset, first.wrap) == (second.uv_scale, second.uv_offset, second.wrap)


def unmirrored(texture: ImageTexture) -> ImageTexture:
    """A texture with its picture mirrored along the axes whose scales are negative."""
    image, scale, offset = texture.image, list(texture.uv_scale), list(texture.uv_offset)
    for axis in (0, 1):
        if scale[axis] < 0.0:
            image = np.flip(image, 1 - axis)
            scale[axis], offset[axis] = -scale[axis], 1.0 - offset[axis]
    placed = (scale[0], scale[1]), (offset[0], offset[1])
    return ImageTexture(np.ascontiguousarray(image), *placed, texture.wrap, texture.filter, texture.source)


def as_file(texture: ImageTexture) -> bytes | None:
    """The content of the PNG or JPEG file of a picture of colours; None if there is none, or its colours differ."""
    path = Path(texture.source)
    if path.suffix.lower() in _FILES and path.is_file() and np.array_equal(read_image(path), texture.image):
        return path.read_bytes()
    return None


@cache
def _between_codes() -> Float[NDArray[np.float64], 255]:
    """Linear values halfway between those of neighbouring 8-bit sRGB values."""
    values = decode_srgb(np.arange(256, dtype=np.uint8)).astype(np.float64)
    return 0.5 * (values[1:] + values[:-1])


def srgb_codes(image: NDArray[np.floating]) -> UInt8[NDArray, ...]:
    """The 8-bit sRGB values whose linear values are nearest; the inverse of decoding."""
    return np.searchsorted(_between_codes(), image).astype(np.uint8)


def number_codes(image: NDArray[np.floating]) -> UInt8[NDArray, ...]:
    """The 8-bit values of numbers from 0 to 1."""
    return np.rint(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8)


def in_bytes(image: NDArray[np.floating], numbers: bool = False) -> bool:
    """Whether 8-bit sRGB values, or 8-bit numbers, hold an image."""
    if numbers:
        return np.array_equal(number_codes(image).astype(np.float32) / np.float32(255.0), image)
    return np.array_equal(decode_srgb(srgb_codes(image)), image)
