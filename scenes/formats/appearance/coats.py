"""A diffuse base under a smooth coat, and the colour of light that bounces between the two.

The coat reflects some of the light from the base back to it. Mitsuba's plastic sums these bounces without their colour:
a base of albedo ``p`` reflects ``p / (1 - f)``, where ``f`` is the internal reflectance of the coat. Its ``nonlinear``
plastic and PBRT v4 include the colour: ``p / (1 - p f)``.

Rough coats of Mitsuba also lose light, the more the rougher they are and the greater their index.

Source: Mitsuba 0.5 documentation, "plastic"; the geometric series of the bounces.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import ConstantTexture, Rgb, Texture
from scenes.formats.appearance.folding import ValueChange, changed, mean_of
from scenes.formats.appearance.indices import mean_reflectance
from scenes.formats.appearance.spectra import rgb
from scenes.formats.losses import LossReport

STRONGEST = 0.25
"""Greatest reflectance at normal incidence of a coat that is written as plastic; its index is 3."""

_REFLECTANCES, _ALPHAS = (0.0, 0.01, 0.04, 0.1, 0.25), (0.0, 0.05, 0.1, 0.2, 0.4, 0.7)
_PASSED = np.array([
    [1.0, 1.0, 1.0, 1.0, 1.0, 1.0], [0.99, 0.977, 0.97, 0.94, 0.843, 0.724],
    [0.96, 0.933, 0.923, 0.885, 0.759, 0.585], [0.9, 0.851, 0.838, 0.786, 0.635, 0.437],
    [0.75, 0.653, 0.628, 0.547, 0.374, 0.205],
])  # fmt: skip
"""What a white base reflects in Mitsuba 3.9's ``roughplastic`` under even light, seen 37 degrees off the normal, by the
reflectance and alpha of the coat; without a coat and without roughness the closed form. The sum of ``eval`` of the
diffuse component over 96 directions."""


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


def under_rough_coat(
    base: Texture, coat: Rgb, kept: float, alpha: float, where: str, report: LossReport
) -> Texture:  # fmt: skip
    """The base for Mitsuba's plastic that reflects as much as one that a coat dims once.

    Args:
        base: albedo below the coat.
        coat: reflectance of the coat at normal incidence, for each colour.
        kept: greatest reflectance that the plastic's coat has; the base reflects what is more.
        alpha: roughness of the coat.
        where: place for messages.
        report: receives the loss of colours that would be above white.
    """
    along = [np.interp(alpha, _ALPHAS, row) for row in _PASSED]
    passed, whole = float(np.interp(kept, _REFLECTANCES, along)), np.array(coat)
    most = [0.0]

    def change(p: NDArray[np.float64]) -> NDArray[np.float64]:
        made = ((1.0 - whole) * p + np.maximum(whole - kept, 0.0)) / passed
        most[0] = max(most[0], float(made.max()))
        return np.minimum(made, 1.0)

    found = _recoloured(base, change, where, report)
    if most[0] > 1.0:
        report.add(where, f"a base of up to {most[0]:.3g} below a rough coat of plastic", "white there")
    return found


def _recoloured(base: Texture, change: ValueChange, where: str, report: LossReport) -> Texture:
    made = changed(base, change)
    if made is None:
        report.add(where, "a texture under a coat", "that of their mean")
        return ConstantTexture(rgb(change(np.array(mean_of(base)))))
    return made
