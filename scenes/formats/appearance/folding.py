"""Products, mixtures and means of textures; products and mixtures are folded into simpler textures where that is
lossless."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from scenes.canonical import (
    Bumped,
    CheckerboardTexture,
    ConstantTexture,
    ImageTexture,
    MixTexture,
    Rgb,
    ScaleTexture,
    Texture,
)
from scenes.formats.appearance.graphs import once_a_node
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.losses import LossReport

ValueChange = Callable[[np.ndarray], np.ndarray]
Join = Callable[[np.ndarray, np.ndarray], np.ndarray]
Pairs = Callable[[Texture, Texture], Texture | None]

_ROUNDED = 1e-6
"""Difference from a bound that rounding makes."""


def folded(texture: Texture) -> Texture:
    """The texture with products and mixtures folded where one part is constant or both parts have the same layout."""
    return once_a_node(_fold, texture)


def _fold(texture: Texture, again: Callable[[Texture], Texture]) -> Texture:
    if isinstance(texture, CheckerboardTexture):
        parts = again(texture.even), again(texture.odd)
        same = parts[0] is texture.even and parts[1] is texture.odd
        return texture if same else CheckerboardTexture(*parts, texture.uv_scale)
    if not isinstance(texture, ScaleTexture | MixTexture):
        return texture
    first, second = again(texture.first), again(texture.second)
    made = _of_two(first, second, _product if isinstance(texture, ScaleTexture) else _mixture(texture.amount))
    return texture if made is None else made


def _product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first * second


def _mixture(amount: float) -> Join:
    return lambda first, second: (1.0 - amount) * first + amount * second


def _of_two(first: Texture, second: Texture, join: Join) -> Texture | None:
    """Two textures combined point by point, or None if the result is not a plain texture."""
    found: dict[tuple[int, int], Texture | None] = {}

    def again(first: Texture, second: Texture) -> Texture | None:
        key = id(first), id(second)
        if key not in found:
            found[key] = _joined(first, second, join, again)
        return found[key]

    return again(first, second)


def _joined(first: Texture, second: Texture, join: Join, again: Pairs) -> Texture | None:
    if isinstance(first, ConstantTexture):
        value = np.array(first.value)
        return changed(second, lambda other: join(value, other))
    if isinstance(second, ConstantTexture):
        value = np.array(second.value)
        return changed(first, lambda other: join(other, value))
    if isinstance(first, CheckerboardTexture) and isinstance(second, CheckerboardTexture):
        if first.uv_scale != second.uv_scale:
            return None
        parts = again(first.even, second.even), again(first.odd, second.odd)
        return None if parts[0] is None or parts[1] is None else CheckerboardTexture(parts[0], parts[1], first.uv_scale)
    if isinstance(first, ImageTexture) and isinstance(second, ImageTexture):
        placed = [(one.uv_scale, one.uv_offset, one.wrap, one.filter, one.image.shape) for one in (first, second)]
        if placed[0] != placed[1]:
            return None
        image = join(first.image, second.image).astype(np.float32)
        return ImageTexture(image, first.uv_scale, first.uv_offset, first.wrap, first.filter)
    return None


def changed(texture: Texture, change: ValueChange) -> Texture | None:
    """A texture with every colour changed, or None if it is not plain."""
    return once_a_node(lambda node, again: _change(node, change, again), texture)


def _change(texture: Texture, change: ValueChange, again: Callable[[Texture], Texture | None]) -> Texture | None:
    if isinstance(texture, ConstantTexture):
        value: Rgb = rgb(change(np.array(texture.value)))
        return ConstantTexture(value)
    if isinstance(texture, CheckerboardTexture):
        parts = again(texture.even), again(texture.odd)
        return None if parts[0] is None or parts[1] is None else CheckerboardTexture(*parts, texture.uv_scale)  # type: ignore[arg-type]
    if isinstance(texture, ImageTexture) and texture.wrap != "black":
        image = change(texture.image.astype(np.float64)).astype(np.float32)
        return ImageTexture(image, texture.uv_scale, texture.uv_offset, texture.wrap, texture.filter)
    return None


def product_of(first: Texture, second: Texture) -> Texture:
    """The product of two textures; a constant if both are, and the other one if one is white."""
    if isinstance(first, ConstantTexture) and isinstance(second, ConstantTexture):
        return ConstantTexture(rgb(np.multiply(first.value, second.value)))
    if isinstance(first, ConstantTexture) and first.value == (1.0, 1.0, 1.0):
        return second
    if isinstance(second, ConstantTexture) and second.value == (1.0, 1.0, 1.0):
        return first
    return ScaleTexture(first, second)


def greatest_of(texture: Texture) -> float:
    """The greatest value of any channel of a texture, or an upper bound if two textures are multiplied."""
    return once_a_node(_greatest, texture)


def _greatest(texture: Texture, again: Callable[[Texture], float]) -> float:
    if isinstance(texture, ConstantTexture):
        return max(texture.value)
    if isinstance(texture, ImageTexture):
        return float(texture.image.max())
    if isinstance(texture, CheckerboardTexture):
        return max(again(texture.even), again(texture.odd))
    parts = again(texture.first), again(texture.second)
    return parts[0] * parts[1] if isinstance(texture, ScaleTexture) else max(parts)


def is_binary(texture: Texture) -> bool:
    """Whether all values of a texture are 0 or 1, between its texels aside."""
    return once_a_node(_binary, texture)


def _binary(texture: Texture, again: Callable[[Texture], bool]) -> bool:
    if isinstance(texture, ConstantTexture):
        return set(texture.value) <= {0.0, 1.0}
    if isinstance(texture, ImageTexture):
        return bool(np.isin(texture.image, (0.0, 1.0)).all())
    return isinstance(texture, CheckerboardTexture) and again(texture.even) and again(texture.odd)


def height_of(material: Bumped) -> Texture:
    """The height of a bump map in scene units, with its scale applied."""
    return product_of(material.height, ConstantTexture(grey(material.scale)))


def mean_of(texture: Texture) -> Rgb:
    """Mean colour of a texture over the unit square of its coordinates."""
    return once_a_node(_mean, texture)


def _mean(texture: Texture, again: Callable[[Texture], Rgb]) -> Rgb:
    if isinstance(texture, ConstantTexture):
        return texture.value
    if isinstance(texture, ImageTexture):
        return rgb(texture.image.reshape(-1, 3).mean(axis=0, dtype=np.float64))
    if isinstance(texture, CheckerboardTexture):
        return rgb(0.5 * (np.array(again(texture.even)) + again(texture.odd)))
    if isinstance(texture, ScaleTexture):
        return rgb(np.multiply(again(texture.first), again(texture.second)))
    weights = 1.0 - texture.amount, texture.amount
    return rgb(weights[0] * np.array(again(texture.first)) + weights[1] * np.array(again(texture.second)))


def within_one(value: Rgb, where: str, report: LossReport) -> Rgb:
    """A reflectance for targets that refuse or change those outside of [0, 1], which is reported."""
    if max(value) <= 1.0 and min(value) >= 0.0:
        return value
    beyond = max(value) if max(value) > 1.0 else min(value)
    if not -_ROUNDED <= beyond <= 1.0 + _ROUNDED:
        report.add(where, f"a reflectance of {beyond:.4g}", "one within 0 and 1")
    return rgb(np.clip(value, 0.0, 1.0))
