"""From a batch of framelets to signed sample-rate errors on the field.

Source: Stephens 2011, sec. 5.3.2–5.3.4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float
from torch import Tensor

from tsar import haar
from tsar.cache import FrameletCache
from tsar.choices import NORMS
from tsar.config import ErrorConfig, TsarConfig
from tsar.morton import morton_to_raster, raster_to_morton, tile_interval
from tsar.roots import square_root
from tsar.types import LUMINANCE, Errors, FrameletBatch

OCTAVES_OF_FULL_ERROR = 8.0
"""Ratio of signal and template, as a power of two, from which a signed difference is ±1."""

_POWER_LEAST, _POWER_MOST = torch.finfo(torch.float32).tiny, 2.0**100

RADIANCE_MAX = 1e30
"""Radiance beyond which a sample counts as not finite, so that sums of many samples fit into float32."""


@dataclass(frozen=True)
class Estimate:
    """Errors on the field, the repaired colours, the new wavelet state, and how many samples were not finite."""

    errors: Errors
    color: Float[Tensor, "n samples 3"]
    coefficients: Float[Tensor, "n state"]
    nonfinite: int


def estimate(
    batch: FrameletBatch, color: Float[Tensor, "n samples 3"], cache: FrameletCache, config: TsarConfig
) -> Estimate:
    """Errors from a freshly rendered batch; zero outside its extent, temporal error zero where a tile has no past."""
    color, nonfinite = replace_nonfinite(color, config.framelet_side)
    state, has_state = cache.previous(batch.level, batch.index)
    octaves, coefficients = haar.transform(compressed_luminance(color), state, has_state)
    spatial, temporal = levelwise_power(octaves, config.error)
    phi_s = signed_error(spatial, config.error.spatial_offset, config.error.spatial_slope, config.error)
    phi_t = signed_error(temporal, config.error.temporal_offset, config.error.temporal_slope, config.error)
    phi_t = torch.where(has_state[:, None], phi_t, 0.0)
    fields = scatter_to_field(torch.stack((phi_s, phi_t)), batch, config)
    return Estimate(Errors(fields[0], fields[1]), color, coefficients, nonfinite)


def count_nonfinite(color: Float[Tensor, "*n 3"]) -> int:
    """How many samples :func:`replace_nonfinite` would replace."""
    if color.numel() == 0:
        return 0
    least, most = torch.aminmax(color)
    # one pass over the samples where all are finite, as they nearly always are; NaN passes through
    if least >= -RADIANCE_MAX and most <= RADIANCE_MAX:
        return 0
    return int(_bad(color).sum())


def _bad(color: Float[Tensor, "*n 3"]) -> Bool[Tensor, "*n"]:
    """Which samples have a channel that is not finite, or beyond ``RADIANCE_MAX``."""
    return ~(color.abs() <= RADIANCE_MAX).all(dim=-1)


def replace_nonfinite(color: Float[Tensor, "n samples 3"], side: int) -> tuple[Float[Tensor, "n samples 3"], int]:
    """Replace samples with a channel that is not finite, or beyond ``RADIANCE_MAX``, by the mean of their finite 3 x 3
    neighbours within the framelet, or of the whole framelet where there are none, or by black where nothing is finite.
    Returns how many were replaced."""
    bad = _bad(color)
    count = int(bad.sum())
    if count == 0:
        return color, 0
    rows = bad.any(dim=1).nonzero().squeeze(1)
    good = (~bad[rows]).to(color.dtype)[..., None]
    planes = torch.cat((torch.where(bad[rows][..., None], 0.0, color[rows]), good), dim=2)
    image = planes[:, raster_to_morton(side)].transpose(1, 2).reshape(-1, 4, side, side)
    near = F.avg_pool2d(image, 3, stride=1, padding=1).flatten(2)[..., morton_to_raster(side)].transpose(1, 2)
    whole = planes.mean(dim=1, keepdim=True).expand_as(near)
    use = torch.where(near[..., 3:] > 0, near, whole)
    mean = use[..., :3] / use[..., 3:].clamp(min=torch.finfo(color.dtype).tiny)
    repaired = color.clone()
    repaired[rows] = torch.where(bad[rows][..., None], mean, color[rows])
    return repaired, count


def compressed_luminance(color: Float[Tensor, "*n 3"]) -> Float[Tensor, "*n"]:
    """Rec. 709 luminance ``Y`` of linear RGB mapped to ``sqrt(Y / (1 + Y))`` in [0, 1).

    The shoulder keeps one very bright sample from saturating a whole tile; the root spreads dark tones about as a
    display's encoding does. Negative luminance counts as black.
    """
    # no matrix product: some libraries round it differently by the number of threads
    red, green, blue = (share * part for share, part in zip(LUMINANCE, color.unbind(-1), strict=True))
    luminance = (red + green + blue).clamp(min=0.0)
    return square_root(luminance / (1.0 + luminance))


def levelwise_power(
    octaves: list[haar.Octave], config: ErrorConfig
) -> tuple[Float[Tensor, "octaves n p"], Float[Tensor, "octaves n p"]]:
    """Localised levelwise norm: spatial and temporal power per octave at every position of the finest octave.

    Octants ghh, hgh, ggh make the spatial norm and hhg, hgg, ghg the temporal one; ggg is not used. A coefficient of a
    coarse octave spreads over the positions it covers as the norm says: see :mod:`tsar.norms`.

    Source: Stephens 2011, sec. 5.3.2.
    """
    norm, spatial, temporal = NORMS[config.norm], [], []
    positions = octaves[0].ghh.shape[1]
    for octave in octaves:
        repeat = positions // octave.ghh.shape[1]
        for norms, octants in (
            (spatial, (octave.ghh, octave.hgh, octave.ggh)),
            (temporal, (octave.hhg, octave.hgg, octave.ghg)),
        ):
            power = norm(torch.stack(octants).square(), repeat)
            norms.append(power.repeat_interleave(repeat, dim=1))
    return torch.stack(spatial), torch.stack(temporal)


def template_power(octaves: int, offset: float, slope: float, config: ErrorConfig) -> Float[Tensor, " octaves"]:
    """Power the template tolerates per position, fine to coarse, on the normalisation of :func:`levelwise_power`.

    ``log2 = offset + slope * f`` per coefficient with ``f = 0`` at the coarsest octave, times the share of one
    coefficient that the norm gives a position; float64, which holds every slope and offset of the configuration.
    Source: Stephens 2011, sec. 5.3.3.2.

    Raises:
        ValueError: the norm gives a position nothing of a coefficient.
    """
    finest = octaves - 1
    logarithms = (offset + slope * f + _share_octaves(config.norm, 4 ** (finest - f)) for f in range(finest, -1, -1))
    return torch.tensor([2.0**power for power in logarithms], dtype=torch.float64)


@lru_cache(maxsize=64)
def _share_octaves(norm: str, repeat: int) -> float:
    """log2 of the power that each of ``repeat`` positions gets of one coefficient of power 1."""
    alone = torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64).reshape(3, 1, 1)
    share = float(NORMS[norm](alone, repeat))
    if not 0.0 < share < math.inf:
        raise ValueError(f"error.norm: expected {norm} to give a position a share of a coefficient, got {share:g}")
    return math.log2(share)


def tolerated_power(octaves: int, offset: float, slope: float, config: ErrorConfig) -> float:
    """:func:`template_power`, summed over octaves and kept within what float32 holds.

    The power of a signal is 0 or lies between these bounds, so a template beyond a bound gives the same errors as one
    at the bound.
    """
    return min(max(float(template_power(octaves, offset, slope, config).sum()), _POWER_LEAST), _POWER_MOST)


def signed_error(
    power: Float[Tensor, "octaves n p"], offset: float, slope: float, config: ErrorConfig
) -> Float[Tensor, "n p"]:
    """Signal against template as a number in [-1, 1]: -1 for a constant tile, 0 where the two agree.

    With S and T the powers summed over octaves, ``contrast`` is ``(S - T) / (S + T)`` and ``difference`` is
    ``log2(S / T) / 8`` clamped. Source: Stephens 2011, sec. 5.3.3.1, which gives the signed difference only.

    Deviation: the thesis does not say how the difference becomes a number in [-1, 1].
    """
    signal = power.sum(0)
    template = torch.tensor(tolerated_power(power.shape[0], offset, slope, config), dtype=signal.dtype)
    if config.form == "contrast":
        return (signal - template) / (signal + template)
    floor = torch.finfo(signal.dtype).tiny
    # float64, for the last digit of a logarithm depends on the processor
    octaves = torch.log2((signal.clamp(min=floor) / template).to(torch.float64)).to(signal.dtype)
    return (octaves / OCTAVES_OF_FULL_ERROR).clamp(-1.0, 1.0)


def scatter_to_field(values: Float[Tensor, "k n p"], batch: FrameletBatch, config: TsarConfig) -> Float[Tensor, "k e"]:
    """Write per-position values of each framelet into the field elements it covers, zero elsewhere.

    Where an element covers several positions it gets their mean, where a position covers several elements each gets
    its value. One pass a level; tiles of a batch never overlap, so the order cannot matter.
    """
    field = torch.zeros(values.shape[0], config.sdf_side**2)
    first, _ = tile_interval(batch.level, batch.index, config.field_level)
    positions = values.shape[2]
    for level in range(config.level_min, config.level_max + 1):
        rows = (batch.level == level).nonzero().squeeze(1)
        if rows.numel() == 0:
            continue
        elements = 4 ** (config.field_level - level)
        local = values[:, rows]
        if elements <= positions:
            local = local.reshape(*local.shape[:2], elements, -1).mean(3)
        else:
            local = local.repeat_interleave(elements // positions, dim=2)
        where = first[rows, None] + torch.arange(elements)
        field[:, where] = local
    return field
