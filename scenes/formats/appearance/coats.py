"""A diffuse base under a smooth coat, and the colour of light that bounces between the two.

The coat reflects some of the light from the base back to it. Mitsuba's plastic sums these bounces without their colour:
a base of albedo ``p`` reflects ``p / (1 - f)``, where ``f`` is the internal reflectance of the coat. Its ``nonlinear``
plastic and PBRT v4 include the colour: ``p / (1 - p f)``.

Source: Mitsuba 0.5 documentation, "plastic"; the geometric series of the bounces.
"""

from __future__ import annotations

import numpy as np

from scenes.canonical import ConstantTexture, Texture
from scenes.formats.appearance.folding import ValueChange, changed, mean_of
from scenes.formats.appearance.indices import mean_reflectance
from scenes.formats.appearance.spectra import rgb
from scenes.formats.losses import LossReport


def sent_back(ior: float) -> float:
    """Internal diffuse reflectance of a smooth coat: ``1 - (1 - F) / ior²``, with the external one ``F``."""
    return 1.0 - (1.0 - mean_reflectance(ior)) / (ior * ior) if ior > 1.0 else 0.0


def without_bounces(base: Texture, ior: float, where: str, report: LossReport) -> Texture:
    """The base for a model without the colour of the bounces: ``p (1 - f) / (1 - p f)``."""
    back = sent_back(ior)
    return _recoloured(base, lambda p: p * (1.0 - back) / np.maximum(1.0 - p * back, 1e-6), where, report)


def with_bounces(base: Texture, ior: float, where: str, report: LossReport) -> Texture:
    """The inverse of :func:`without_bounces`."""
    back = sent_back(ior)
    return _recoloured(base, lambda p: p / np.maximum(1.0 - back + p * back, 1e-6), where, report)


def _recoloured(base: Texture, change: ValueChange, where: str, report: LossReport) -> Texture:
    made = changed(base, change)
    if made is None:
        report.add(where, "a texture under a coat", "that of their mean")
        return ConstantTexture(rgb(change(np.array(mean_of(base)))))
    return made
