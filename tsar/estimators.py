"""Estimators of a framelet's power in space and in time, from which the error is computed.

Each estimator takes the new samples of tiles and the state kept from their last updates. It returns spatial and
temporal power per band in equal parts of a tile, and the power that the template tolerates there. The state is
``(n, state)`` for ``n`` tiles; :func:`state_size` gives its length.

* ``dwt``: the streaming Haar transform and its localised levelwise norm, one band per octave (sec. 5.3.2–5.3.4).
* ``variance``: the variance of a part's samples, and that of each sample and the one before it, in one band (sec.
  5.2.1).
* ``fft``: the Fourier transform of a tile's last ``FFT_UPDATES`` updates under a Hann window, one band per octave. It
  does not localise power within a tile (sec. 5.3.1).

All are compared with the same template. If the wavelet coefficients of a band have power P each, the band contributes
``P / 4`` to the variance of the samples; the latter two estimators tolerate that variance.

Deviation: sec. 5.2 and 5.3.1 name the variance and the Fourier transform but give no equation for an estimate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from tsar import haar
from tsar.choices import NORMS
from tsar.config import ErrorConfig
from tsar.morton import raster_to_morton

FFT_UPDATES = 8
"""Number of updates that the window of the Fourier transform spans."""

_POWER_LEAST, _POWER_MOST = torch.finfo(torch.float32).tiny, 2.0**100


@dataclass(frozen=True)
class Bands:
    """Power of framelets per band, fine to coarse, in equal parts of each framelet, Morton order.

    Attributes:
        power: power per band, spatial or temporal, of the compressed luminance squared.
        tolerated: power that the template has in its place.
        known: whether a band of a framelet has been measured.
    """

    power: Float[Tensor, "bands n parts"]
    tolerated: Float[Tensor, " bands"]
    known: Bool[Tensor, "bands n"]


Measure = Callable[[Tensor, Tensor, Tensor, int, ErrorConfig], tuple[Bands, Bands, Tensor]]
"""``(signal, state, has_state, parts, config) -> (spatial, temporal, state)``. ``signal`` is ``(n, samples)`` in Morton
order, ``state`` and ``has_state`` are as in :func:`tsar.haar.transform`, and ``parts`` is a power of four up to a
quarter of the samples."""


def state_size(samples: int, config: ErrorConfig) -> int:
    """Count of the numbers that the estimator of a configuration keeps per tile."""
    sizes = {"dwt": haar.state_size(samples), "variance": samples, "fft": (FFT_UPDATES - 1) * samples + 1}
    return sizes[config.estimator]


def measure(
    signal: Float[Tensor, "n samples"],
    state: Float[Tensor, "n state"],
    has_state: Bool[Tensor, " n"],
    parts: int,
    config: ErrorConfig,
) -> tuple[Bands, Bands, Float[Tensor, "n state"]]:
    """Spatial and temporal power by the estimator of the configuration, and the tiles' new state."""
    return _MEASURES[config.estimator](signal, state, has_state, parts, config)


def levelwise_power(
    octaves: list[haar.Octave], parts: int, config: ErrorConfig
) -> tuple[Float[Tensor, "octaves n parts"], Float[Tensor, "octaves n parts"]]:
    """Localised levelwise norm: spatial and temporal power per octave in each of ``parts`` equal parts of a tile.

    With the norm l2 the spatial power is ``sum(ghh² + hgh² + ggh²)`` and the temporal one ``sum(hhg² + hgg² + ghg²)``;
    ggg is not used. All coefficients within a part enter its norm, and a coefficient that covers several parts enters
    each with an equal share (fig. 5.10).

    Source: Stephens 2011, sec. 5.3.2.
    """
    norm, spatial, temporal = NORMS[config.norm], [], []
    for octave in octaves:
        within, repeat = _shares(octave.ghh.shape[1], parts)
        for norms, octants in (
            (spatial, (octave.ghh, octave.hgh, octave.ggh)),
            (temporal, (octave.hhg, octave.hgg, octave.ghg)),
        ):
            squared = torch.stack(octants).square().unflatten(2, (-1, within))
            power = norm(squared.permute(3, 0, 1, 2).flatten(0, 1), repeat)
            norms.append(power.repeat_interleave(repeat, dim=1))
    return torch.stack(spatial), torch.stack(temporal)


def _shares(positions: int, parts: int) -> tuple[int, int]:
    """Number of an octave's positions within a part, and number of parts that a position covers."""
    return max(positions // parts, 1), max(parts // positions, 1)


def template_power(
    samples: int, parts: int, offset: float, slope: float, config: ErrorConfig
) -> Float[Tensor, " octaves"]:
    """Power the template tolerates in a part, fine to coarse, on the normalisation of :func:`levelwise_power`.

    Per coefficient ``log2 power = offset + slope * f`` with ``f = 0`` at the coarsest octave. It is multiplied by the
    norm of as many coefficients of power 1 as a part has positions. Computed in float64, which holds every slope and
    offset, and clamped to the range of a signal's powers in float32.

    Source: Stephens 2011, sec. 5.3.3.2.

    Raises:
        ValueError: the norm gives a part no share of a coefficient.
    """
    finest = haar.octave_count(samples) - 1
    found = []
    for f in range(finest, -1, -1):
        share = _share_octaves(config.norm, *_shares(4**f, parts))
        found.append(min(max(2.0 ** (offset + slope * f + share), _POWER_LEAST), _POWER_MOST))
    return torch.tensor(found, dtype=torch.float64)


@lru_cache(maxsize=64)
def _share_octaves(norm: str, within: int, repeat: int) -> float:
    """log2 of the norm of ``within`` coefficients of power 1 that ``repeat`` parts share."""
    alone = torch.zeros(3 * within, 1, 1, dtype=torch.float64)
    alone[:within] = 1.0
    share = float(NORMS[norm](alone, repeat))
    if not 0.0 < share < math.inf:
        raise ValueError(f"error.norm: expected {norm} to give a part a share of a coefficient, got {share:g}")
    return math.log2(share)


def _templates(samples: int, parts: int, config: ErrorConfig) -> tuple[Tensor, Tensor]:
    spatial = template_power(samples, parts, config.spatial_offset, config.spatial_slope, config)
    return spatial, template_power(samples, parts, config.temporal_offset, config.temporal_slope, config)


def _by_wavelets(
    signal: Tensor, state: Tensor, has_state: Tensor, parts: int, config: ErrorConfig
) -> tuple[Bands, Bands, Tensor]:
    octaves, after = haar.transform(signal, state, has_state)
    power_s, power_t = levelwise_power(octaves, parts, config)
    known = torch.stack([octave.known for octave in octaves])
    tolerated_s, tolerated_t = _templates(signal.shape[1], parts, config)
    return Bands(power_s, tolerated_s, torch.ones_like(known)), Bands(power_t, tolerated_t, known), after


def _variance_template(samples: int, config: ErrorConfig) -> tuple[Tensor, Tensor]:
    """Variance of a sample per octave, spatial and temporal, if every coefficient has the tolerated power."""
    lines = config.spatial_offset, config.spatial_slope, config.temporal_offset, config.temporal_slope
    spatial, temporal = _templates(samples, samples // 4, ErrorConfig(*lines))
    return 0.25 * spatial, 0.25 * temporal


def _by_variance(
    signal: Tensor, state: Tensor, has_state: Tensor, parts: int, config: ErrorConfig
) -> tuple[Bands, Bands, Tensor]:
    """The variance ``mean((x - mean(x))²)`` (eq. 5.5) of the samples of a part; and that of each sample and the one
    before it, averaged over the part."""
    cut = signal.unflatten(1, (parts, -1))
    spatial = (cut - cut.mean(2, keepdim=True)).square().mean(2)
    before = torch.where(has_state[:, None], state, signal)
    temporal = (0.5 * (signal - before)).square().unflatten(1, (parts, -1)).mean(2)
    tolerated_s, tolerated_t = (one.sum(0, keepdim=True) for one in _variance_template(signal.shape[1], config))
    always = torch.ones_like(has_state)[None]
    return Bands(spatial[None], tolerated_s, always), Bands(temporal[None], tolerated_t, has_state[None]), signal


def _by_fourier(
    signal: Tensor, state: Tensor, has_state: Tensor, parts: int, config: ErrorConfig
) -> tuple[Bands, Bands, Tensor]:
    """Power of the last updates per octave of frequency. While there are too few updates, the oldest one replaces those
    that are missing, and the temporal bands are unknown."""
    count, samples = signal.shape
    updates = torch.where(has_state, state[:, -1], 0.0)
    past = state[:, :-1].reshape(count, FFT_UPDATES - 1, samples)
    past = torch.where(has_state[:, None, None], past, signal[:, None])
    volume = torch.cat((signal[:, None], past), dim=1)  # newest first: power does not depend on the direction of time
    power_s, power_t = (one[..., None].expand(-1, -1, parts) for one in octave_power(volume))
    tolerated_s, tolerated_t = _variance_template(samples, config)
    known = (updates >= FFT_UPDATES - 1).expand(len(power_t), count)
    always = torch.ones(len(power_s), count, dtype=torch.bool)
    more = (updates + 1.0).clamp(max=FFT_UPDATES - 1.0)
    after = torch.cat((volume[:, :-1].flatten(1), more[:, None]), dim=1)
    spatial, temporal = Bands(power_s, tolerated_s, always), Bands(power_t, tolerated_t[: len(power_t)], known)
    return spatial, temporal, after


def octave_power(
    volume: Float[Tensor, "n t samples"],
) -> tuple[Float[Tensor, "spatial n"], Float[Tensor, "temporal n"]]:
    """Variance of the samples of tiles per octave of frequency, fine to coarse, under a Hann window along all axes.

    A frequency belongs to the spatial or to the temporal bands, by the finer of its two octaves, and to the temporal
    ones if the octaves are equal. One period per span counts as static, because the window spreads static content that
    far.
    """
    frames, samples = volume.shape[1:]
    side = math.isqrt(samples)
    planes = volume[..., raster_to_morton(side)].unflatten(2, (side, side))
    along_t, along_y = torch.hann_window(frames), torch.hann_window(side)
    window = along_t[:, None, None] * along_y[:, None] * along_y
    mean = (planes * window).sum((1, 2, 3), keepdim=True) / window.sum()
    power = torch.fft.rfftn((planes - mean) * window, dim=(1, 2, 3)).abs().square()
    power[..., 1:-1] *= 2.0  # the negative frequencies along x
    power = (power / (window.square().sum() * window.numel())).flatten(1)
    axis, bands = _bands(frames, side)
    found = []
    for number, octaves in ((0, haar.octave_count(samples)), (1, frames.bit_length() - 2)):
        found.append(torch.stack([power[:, (axis == number) & (bands == o)].sum(1) for o in range(octaves)]))
    return found[0], found[1]


@lru_cache(maxsize=4)
def _bands(frames: int, side: int) -> tuple[Int64[Tensor, " frequencies"], Int64[Tensor, " frequencies"]]:
    """For each frequency of a real transform, 0 if it is spatial or 1 if it is temporal, and its octave."""
    none = 99
    t, y, x = (torch.fft.fftfreq(n, 1.0 / n).abs() for n in (frames, side, side))
    space = torch.maximum(y[:, None], x[: side // 2 + 1])
    octave_s = torch.where(space > 0, torch.log2(side / 2 / space.clamp(min=1.0)).floor(), none)
    octave_t = torch.where(t > 1, torch.log2(frames / 2 / t.clamp(min=1.0)).floor(), none)[:, None, None]
    in_time = (octave_t <= octave_s) & (octave_t < none)
    octave = torch.minimum(octave_s, octave_t)
    return in_time.to(torch.int64).flatten(), octave.to(torch.int64).flatten()


_MEASURES: dict[str, Measure] = {"dwt": _by_wavelets, "variance": _by_variance, "fft": _by_fourier}
