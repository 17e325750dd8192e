"""The picture of the estimates: uncertain pixels take the colours of their surroundings."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from tsar.filtering.records import NOTHING_KNOWN, VARIANCE_MAX, Estimates, Surfels
from tsar.policies.resampling import double_width
from tsar.roots import square_root


def displayed(
    estimates: Estimates,
    surfels: Surfels | None,
    rate: Float[Tensor, "1 e e"],
    seconds: float,
    between: Float[Tensor, "1 h w"] | None = None,
    picture: tuple[int, int] | None = None,
) -> tuple[Float[Tensor, "3 h w"], Float[Tensor, "1 h w"]]:
    """Picture and variance of its errors ``seconds`` later, :func:`smoothed`. The surfels belong to the estimates; None
    without reprojection. ``between`` is the roughness between pixels where it is not that of the samples. Pixels of the
    greatest variance do not contribute to their surroundings. ``picture`` is the height and width of the picture where
    it is not the whole plane: both results are 0 outside it, and nothing outside contributes."""
    later = estimates.later(rate, seconds)
    if surfels is not None:
        later = later.beside(surfels)
    variance = later.variance
    variance = torch.where(variance < VARIANCE_MAX, variance, NOTHING_KNOWN)
    between = later.roughness if between is None else between
    if picture is None:
        return smoothed(later.color, variance, between)
    (height, width), side = picture, variance.shape[-1]
    shown, remaining = smoothed(*(plane[:, :height, :width] for plane in (later.color, variance, between)))
    beyond = (0, side - width, 0, side - height)
    return F.pad(shown, beyond), F.pad(remaining, beyond)


def smoothed(
    color: Float[Tensor, "3 h w"], variance: Float[Tensor, "1 h w"], roughness: Float[Tensor, "1 h w"]
) -> tuple[Float[Tensor, "3 h w"], Float[Tensor, "1 h w"]]:
    """Picture and variance of its errors, over a pyramid of means of the square roots of colours.

    Roots differ about as much as they look different, and variances are those of roots. Means of colours spread the
    light of a lamp over its dark surroundings.

    Let ``s_l = g 2^l / 2`` at level ``l``. Upwards, a parent is the mean of its children, weighted with
    ``w = 1 / (P_l + s_l)``, and ``P_(l+1) = 1 / sum(w)``. Downwards, with ``J = P_l / (P_l + s_l)`` and the coarser
    level enlarged bilinearly to ``x', V'``, ``x = m_l + J (x' - m_l)`` and ``V = P_l + J² (V' - P_l - s_l)``. Where the
    number of rows or columns is odd, the last parent has fewer children.
    """
    levels = [(square_root(color), variance, roughness)]
    while max(levels[-1][0].shape[1:]) > 1:
        color, variance, roughness = levels[-1]
        weight = 1.0 / (variance + _between(roughness, len(levels) - 1))
        total = 4.0 * _halved(weight)
        levels.append((4.0 * _halved(color * weight) / total, 1.0 / total, _halved(roughness, "replicate")))
    shown, remaining, _ = levels[-1]
    for level in range(len(levels) - 2, -1, -1):
        color, variance, roughness = levels[level]
        between = _between(roughness, level)
        share = variance / (variance + between)
        shown = color + share * (_doubled(shown, color) - color)
        remaining = variance + share * share * (_doubled(remaining, color) - variance - between)
    return shown * shown, remaining


def _between(roughness: Float[Tensor, "1 h w"], level: int) -> Float[Tensor, "1 h w"]:
    return 0.5 * 2.0**level * roughness


def _halved(plane: Float[Tensor, "c h w"], beyond: str = "constant") -> Float[Tensor, "c h2 w2"]:
    height, width = plane.shape[1:]
    if height % 2 or width % 2:
        plane = F.pad(plane, (0, width % 2, 0, height % 2), mode=beyond)
    return F.avg_pool2d(plane[None], 2)[0]


def _doubled(plane: Float[Tensor, "c h w"], finer: Float[Tensor, "_ h2 w2"]) -> Float[Tensor, "c h2 w2"]:
    height, width = finer.shape[1:]
    return double_width(double_width(plane).transpose(1, 2)).transpose(1, 2)[:, :height, :width]
