"""Signed sample-rate errors on the field from a batch of framelets.

Source: Stephens 2011, sec. 5.3.2–5.3.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float
from torch import Tensor

from tsar.cache import FrameletCache
from tsar.config import ErrorConfig, TsarConfig
from tsar.estimators import Bands, measure
from tsar.morton import morton_to_raster, raster_to_morton, tile_interval
from tsar.roots import square_root
from tsar.types import LUMINANCE, Errors, FrameletBatch

OCTAVES_OF_FULL_ERROR = 8.0
"""Octaves between the powers of signal and template from which on a signed difference is ±1."""

RADIANCE_MAX = 1e30
"""Radiance beyond which a sample counts as non-finite, so that sums of many samples fit into float32."""


@dataclass(frozen=True)
class Estimate:
    """Errors on the field, repaired colours, the new state of the estimator, and how many samples were not finite."""

    errors: Errors
    color: Float[Tensor, "n samples 3"]
    coefficients: Float[Tensor, "n state"]
    nonfinite: int


def estimate(
    batch: FrameletBatch, color: Float[Tensor, "n samples 3"], cache: FrameletCache, config: TsarConfig
) -> Estimate:
    """Errors from a freshly rendered batch; zero outside its extent, temporal error zero where a tile has no past.

    The power within a part of a tile is summed and then compared with the template (sec. 5.3.2, 5.3.3.1). Levels are
    processed one after the other; tiles of a batch never overlap, so their order has no effect.
    """
    color, nonfinite = replace_nonfinite(color, config.framelet_side)
    state, has_state = cache.previous(batch.level, batch.index)
    signal = compressed_luminance(color)
    fields = signal.new_zeros(2, config.sdf_side**2)
    first, _ = tile_interval(batch.level, batch.index, config.field_level)
    after = torch.empty_like(state)
    for level in range(config.level_min, config.level_max + 1):
        rows = (batch.level == level).nonzero().squeeze(1)
        if rows.numel() == 0:
            continue
        elements = config.elements_of(level)
        phi, after[rows] = errors_of(signal[rows], state[rows], has_state[rows], elements, config.error)
        where = first[rows, None] + torch.arange(elements)
        fields[:, where] = phi.repeat_interleave(elements // phi.shape[2], dim=2)
    return Estimate(Errors(fields[0], fields[1]), color, after, nonfinite)


def errors_of(
    signal: Float[Tensor, "n samples"],
    state: Float[Tensor, "n state"],
    has_state: Bool[Tensor, " n"],
    elements: int,
    config: ErrorConfig,
) -> tuple[Float[Tensor, "2 n parts"], Float[Tensor, "n state"]]:
    """Spatial and temporal errors in equal parts of tiles that cover ``elements`` elements of the field each, and the
    tiles' new state: see :func:`tsar.estimators.measure`."""
    parts = 1 if config.extent == "tile" else min(elements, signal.shape[1] // 4)
    *bands, after = measure(signal, state, has_state, parts, config)
    return torch.stack([signed_error(one, config) for one in bands]), after


def count_nonfinite(color: Float[Tensor, "*n 3"]) -> int:
    """Number of samples that :func:`replace_nonfinite` would replace."""
    if color.numel() == 0:
        return 0
    least, most = torch.aminmax(color)
    # one pass if all samples are finite, as they nearly always are; NaN fails the comparison
    if least >= -RADIANCE_MAX and most <= RADIANCE_MAX:
        return 0
    return int(_bad(color).sum())


def _bad(color: Float[Tensor, "*n 3"]) -> Bool[Tensor, "*n"]:
    """Which samples have a channel that is not finite, or beyond ``RADIANCE_MAX``."""
    return ~(color.abs() <= RADIANCE_MAX).all(dim=-1)


def replace_nonfinite(color: Float[Tensor, "n samples 3"], side: int) -> tuple[Float[Tensor, "n samples 3"], int]:
    """Replace samples with a channel that is not finite, or beyond ``RADIANCE_MAX``, by the mean of their finite 3 x 3
    neighbours within the framelet, or of the whole framelet where no neighbour is finite, or by black where no sample
    is. Returns the samples and the number of those replaced."""
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

    The quotient keeps one very bright sample from saturating a whole tile; the square root resolves dark tones about as
    well as the encoding of a display. Negative luminance counts as black.

    Deviation: the thesis transforms luminance itself (sec. 5.3.4); its pictures have no high dynamic range.
    """
    # no matrix product: in some libraries its rounding depends on the number of threads
    red, green, blue = (share * part for share, part in zip(LUMINANCE, color.unbind(-1), strict=True))
    luminance = (red + green + blue).clamp(min=0.0)
    return square_root(luminance / (1.0 + luminance))


def signed_error(bands: Bands, config: ErrorConfig) -> Float[Tensor, "n parts"]:
    """Error of the signal's power against the template, in [-1, 1]: -1 for a constant tile, 0 where the two agree or
    nothing has been measured.

    With S and T the powers of the signal and of the template, ``contrast`` is ``(S - T) / (S + T)`` and ``difference``
    is ``log2(S / T) / 8``, clamped. If ``octaves`` is ``greatest``, S and T belong to one band each and the greatest
    error is taken; if it is ``sum``, they are sums over the bands. Source: Stephens 2011, sec. 5.3.3.1, which sums
    signed differences.

    Deviation: the thesis does not say how a difference is mapped to [-1, 1]. A sum of differences depends on the sum of
    the template alone, whatever its slope; the greatest difference depends on its shape.
    """
    known = bands.known[..., None]
    tolerated = bands.tolerated.to(bands.power.dtype)[:, None, None]
    if config.octaves == "greatest":
        errors = torch.where(known, _compared(bands.power, tolerated, config), -torch.inf).amax(0)
    else:
        signal, template = (torch.where(known, one, 0.0).sum(0) for one in (bands.power, tolerated))
        errors = _compared(signal, template, config)
    return torch.where(known.any(0), errors, 0.0)


def _compared(signal: Tensor, template: Tensor, config: ErrorConfig) -> Tensor:
    if config.form == "contrast":
        return (signal - template) / (signal + template)
    floor = torch.finfo(signal.dtype).tiny
    # float64: the last digit of a logarithm depends on the processor
    octaves = torch.log2((signal.clamp(min=floor) / template).to(torch.float64)).to(signal.dtype)
    return (octaves / OCTAVES_OF_FULL_ERROR).clamp(-1.0, 1.0)
