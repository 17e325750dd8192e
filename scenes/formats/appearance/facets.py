"""Roughness given by a texture: the alpha of microfacets, and its mean."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from scenes.canonical import ConstantTexture, Glass, Glossy, Metal, Plastic, Texture
from scenes.formats.appearance.folding import ValueChange, changed, folded, mean_of
from scenes.formats.losses import LossReport

Rough = TypeVar("Rough", bound=Metal | Glass | Glossy | Plastic)


@dataclass(frozen=True)
class Facets:
    """Roughness of a material: the alpha along both tangent axes, and its texture if it has one."""

    roughness: tuple[float, float]
    alpha: Texture | None = None


def facets_of(texture: Texture, change: ValueChange | None = None) -> Facets | None:
    """The roughness of a texture, whose values are alphas after ``change``; None if it is not plain.

    Args:
        texture: texture of numbers, the mean of its channels.
        change: function of values ``(h, w, 3)`` or ``(3,)``.
    """

    def alpha(values: np.ndarray) -> np.ndarray:
        even = np.broadcast_to(values.mean(axis=-1, keepdims=True), values.shape)
        return even if change is None else change(even)

    plain = folded(texture)
    made = plain if change is None and not isinstance(plain, ConstantTexture) else changed(plain, alpha)
    if made is None:
        return None
    mean = float(np.mean(mean_of(made)))
    return Facets((mean, mean), None if isinstance(made, ConstantTexture) else made)


def with_even_facets(material: Rough, where: str, report: LossReport) -> Rough:
    """The material with one alpha everywhere; a texture becomes its mean, which is reported."""
    if material.alpha is None:
        return material
    report.add(where, "a texture of the roughness", f"its mean, {float(np.mean(mean_of(material.alpha))):.3g}")
    return replace(material, alpha=None)
