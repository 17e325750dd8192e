"""Noise told from detail, so that noisy pixels are blended more when they are shown.

The roughness is the semivariance of samples per pixel of distance. Samples that are drawn at random differ where the
picture does not, so noise looks like roughness. The estimates tell both apart: differences between neighbours fall with
the number of samples where they are noise, and remain where they are detail.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from tsar.filtering.records import Estimates
from tsar.filtering.samples import ROUGHNESS_MIN
from tsar.roots import encoded

PIXEL_FLOPS = 60.0
"""Operations per output pixel and cycle, as a test counts them in the code."""


def detailed(estimates: Estimates, picture: tuple[int, int] | None = None) -> Float[Tensor, "1 h w"]:
    """The roughness that neighbouring estimates confirm, at most that of the samples.

    Let ``S`` be half the mean squared difference of neighbouring estimates, ``g`` the roughness and ``i`` the inverse
    of the number of samples, each averaged over 3 x 3 pixels. Noise alone gives ``S = g i``. The share of detail is
    ``d = (S - g i) / (g - g i)``, clipped to [0, 1], and the result ``g (i + (1 - i) d)``. With one sample a pixel
    noise and detail cannot be told apart, and the result is ``g``. ``picture`` is the height and width of the picture
    where it is not the whole plane: the result is 0 outside it, and nothing outside contributes.
    """
    side = estimates.inverse.shape[-1]
    height, width = picture or (side, side)
    color, roughness, inverse = (
        plane[:, :height, :width] for plane in (estimates.color, estimates.roughness, estimates.inverse)
    )
    rough, noise = _near(roughness), _near(roughness * inverse)
    most = (rough - noise).clamp(min=ROUGHNESS_MIN)
    detail = ((_near(_differences(color)) - noise) / most).clamp(0.0, 1.0)
    inverse = _near(inverse).clamp(max=1.0)
    found = roughness * (inverse + (1.0 - inverse) * detail)
    return F.pad(found, (0, side - width, 0, side - height))


def _differences(color: Float[Tensor, "3 h w"]) -> Float[Tensor, "1 h w"]:
    """Half the mean squared difference of each pixel from its four neighbours, 0 beyond the border."""
    planes = encoded(color)[:, None]
    total = torch.zeros_like(planes[0])
    for axis in (1, 2):
        size = total.shape[axis] - 1
        red, green, blue = ((one.narrow(axis, 0, size) - one.narrow(axis, 1, size)).square() for one in planes)
        apart = (red + green + blue) / 24.0
        total.narrow(axis, 0, size).add_(apart)
        total.narrow(axis, 1, size).add_(apart)
    return total


def _near(plane: Float[Tensor, "1 h w"]) -> Float[Tensor, "1 h w"]:
    """The mean over 3 x 3 pixels; pixels of the border are repeated beyond it."""
    height, width = plane.shape[1:]
    wide = F.pad(plane[None], (1, 1, 1, 1), mode="replicate")[0]
    across = wide[:, :, :width] + wide[:, :, 1:-1] + wide[:, :, 2:]
    return (across[:, :height] + across[:, 1:-1] + across[:, 2:]) / 9.0
