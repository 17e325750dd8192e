"""Roughness and change from the wavelets of the dissertation: the power of the Haar transform of a tile's samples, and
that of their differences from the estimates in their pixels.

The spatial octants are those of the new samples, the temporal octants those of the differences: the transform is
linear, so ``hhg`` of two fields is ``hh`` of their difference. Power is localised to squares of 2 x 2 samples.

Source: Stephens 2011, sec. 5.3.2 and 5.3.4.

Deviation: estimates that were moved with their surfaces replace the previous samples of a tile, so all octaves use the
same pair of fields. Power is that of encoded colours, averaged over the channels, not of luminance.
"""

from __future__ import annotations

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from tsar import haar
from tsar.filtering.records import Estimates
from tsar.roots import encoded

OCTAVES = 3
"""Octaves of a tile of 8 x 8 samples."""
BROWNIAN = 7.372
"""Power in a square of a surface whose semivariance is proportional to distance and 1 between adjacent samples."""
_NOISE = 2.25
_TOLERANCE = 8.0


def semivariance_of(color: Float[Tensor, "n samples 3"]) -> Float[Tensor, "n samples"]:
    """Semivariance of adjacent samples, one value per sample in Morton order, from encoded colours: the power of all
    octaves in the sample's square of 2 x 2, ``sum_o 4^-o (hg² + gh² + gg²)``, over :data:`BROWNIAN`."""
    power, share = torch.zeros(len(color), color.shape[1] // 4), 1.0
    for _, sides, corner in octants(color):
        own = sides + corner
        power = power + share * own.repeat_interleave(power.shape[1] // own.shape[1], 1)
        share *= 0.25
    return (power / BROWNIAN).repeat_interleave(4, 1)


def residuals(
    estimates: Estimates,
    color: Float[Tensor, "n samples 3"],
    pixel: Int64[Tensor, " flat"],
    count: Float[Tensor, "1 h w"],
) -> tuple[Float[Tensor, "1 h w"], Float[Tensor, "1 h w"]]:
    """Residuals of new samples, and the greatest that noise explains, as in :func:`tsar.filtering.change.residuals`,
    from the octants ``hhg``, ``hgg`` and ``ghg`` of the coarsest octave, which spans the tile.

    The power of a change that is equal at all samples is its square. The power of independent samples of variance ``v``
    is ``2.25 v / 4^o`` at octave ``o``. At most eight times as much is expected from noise, with
    ``v = g i / 2 + 0.8 g``.

    Deviation: only one octave is used. All octaves together measure the whole power of the residual, hardly more than
    plain residuals do; the greatest excess of any octave mistakes noise for change.

    Args:
        estimates: before the batch.
        color: encoded colours of the samples.
        pixel: raster index of the pixel of each, ``side²`` outside the image.
        count: number of samples of each pixel.
    """
    side, (n, samples, _) = count.shape[-1], color.shape
    known = estimates.known.to(torch.float32)
    variance = known * (estimates.observed + 0.8 * estimates.roughness)
    planes = torch.cat((encoded(estimates.color), variance, known)).reshape(5, -1)
    at = planes[:, pixel.clamp(max=side * side - 1)] * (pixel < side * side)
    was, seen = at[:3].T.reshape(n, samples, 3), at[4].reshape(n, samples, 1)
    low, sides, _ = octants((color - was) * seen)[-1]
    usual = _TOLERANCE * _NOISE / 4.0 ** (OCTAVES - 1) * at[3].reshape(n, samples).mean(1, keepdim=True)

    def averaged(tile: Float[Tensor, "n 1"]) -> Float[Tensor, "1 h w"]:
        total = tile.new_zeros(side * side + 1).index_add_(0, pixel, tile.expand(n, samples).reshape(-1))
        return total[:-1].reshape(1, side, side) / count.clamp(min=1.0)

    return averaged(low + sides), averaged(usual)


def octants(field: Float[Tensor, "n samples c"]) -> list[tuple[Float[Tensor, "n p"], ...]]:
    """Power of the octants ``hh``, of ``hg`` and ``gh`` together, and of ``gg``, per octave from fine to coarse,
    averaged over the channels."""
    n, samples, channels = field.shape
    low, found = field.permute(0, 2, 1).reshape(n * channels, samples), []
    for _ in range(OCTAVES):
        hh, hg, gh, gg = haar.spatial_step(low).chunk(4, dim=1)
        low = hh
        powers = hh.square(), hg.square() + gh.square(), gg.square()
        found.append(tuple(power.reshape(n, channels, -1).mean(1) for power in powers))
    return found
