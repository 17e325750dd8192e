"""Check of the error estimator: the agreement of its streaming estimate with the direction to the ideal density.

The estimate φ uses a framelet at the current rates and the previous one. The truth is the direction from those rates to
Θ*, which is found in a volume rendered at higher rates. Source: Stephens 2011, fig. 5.1 and sec. 5.1.2.2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from scipy.stats import rankdata
from torch import Tensor

from analysis.command.progress import Task
from analysis.metrics.arrays import Floats
from analysis.metrics.quality import INTERVAL
from analysis.spectrum.ideal_density import ideal_band, octant_power, power_norm, raster, share_of_total, tile_volume
from analysis.spectrum.options import FRAMELET_SIDE, SpectrumOptions
from tsar.config import ErrorConfig
from tsar.error import errors_of
from tsar.estimators import state_size
from tsar.morton import deinterleave, interleave, morton_to_raster
from tsar.types import Trace

_TIMES = 4
_TILES_AT_ONCE = 16  # bounds memory
_SHARES = (0.003, 0.01, 0.03, 0.1)
_VARIANCES = (1e-5, 1e-4, 1e-3)
_RESAMPLES = 1000
_SHUFFLES = 300


def streaming_error(
    volume: Float[Tensor, "n t y x"], stride_space: int, stride_time: int, config: ErrorConfig, elements: int
) -> Float[Tensor, "n updates 2"]:
    """``(φ_s, φ_t)`` of tiles of ``elements`` elements each, refreshed at a lower rate, by the pipeline's own estimate.

    Framelets of 16 x 16 samples are taken from the volume, several side by side if the stride is fine. Their errors
    are averaged, as are those of the parts of each. The first refresh has no history and gives no update. Samples lie
    half a sample of the volume off the centres of their cells.
    """
    taken = volume[:, ::stride_time, stride_space // 2 :: stride_space, stride_space // 2 :: stride_space]
    tiles, frames, side = taken.shape[0], taken.shape[1], taken.shape[3]
    across = side // FRAMELET_SIDE
    cut = taken.reshape(tiles, frames, across, FRAMELET_SIDE, across, FRAMELET_SIDE).permute(1, 0, 2, 4, 3, 5)
    framelets = cut.reshape(frames, -1, FRAMELET_SIDE**2)[..., morton_to_raster(FRAMELET_SIDE)]
    count = framelets.shape[1]
    state, known = (
        framelets.new_zeros(count, state_size(FRAMELET_SIDE**2, config)),
        torch.zeros(count, dtype=torch.bool),
    )
    updates = []
    for signal in framelets:
        phi, state = errors_of(signal, state, known, max(elements // across**2, 1), config)
        updates.append(phi.reshape(2, tiles, -1).mean(2).T)
        known = torch.ones_like(known)
    return torch.stack(updates[1:], dim=1)


@dataclass(frozen=True)
class Rates:
    """Rates at which the estimate is evaluated on a volume: strides along its sides and its times."""

    space: tuple[int, ...]
    time: tuple[int, ...]

    def densities(self, side: int, frames: int) -> Float[Tensor, "rates 2"]:
        """θ of every pair of rates: samples per tile side, and times per span."""
        pairs = torch.cartesian_prod(torch.tensor(self.space), torch.tensor(self.time)).to(torch.float64)
        return torch.tensor((side, frames), dtype=torch.float64) / pairs


@dataclass(frozen=True)
class Tiles:
    """Measurements of volumes: their norms, the rates, and the estimate at each rate, averaged over the updates and of
    the last update alone."""

    norm: Float[Tensor, "n t s"]
    theta: Float[Tensor, "rates 2"]
    phi: Float[Tensor, "n rates 2"]
    phi_last: Float[Tensor, "n rates 2"]

    def true(self, norm: Float[Tensor, "n t s"], tau: float) -> Floats:
        """Directions to the ideal density, ``(tiles, rates, 2)``: octaves from each rate to it (fig. 5.1)."""
        ideal = 2.0 * torch.stack(ideal_band(norm, tau), dim=-1).to(torch.float64)
        return torch.log2(ideal[:, None] / self.theta).numpy()


def measure(
    volume: Float[Tensor, "n t samples"], rates: Rates, config: ErrorConfig, elements: int
) -> tuple[Tiles, Tensor]:
    """Norms and estimates of volumes of ``elements`` elements of the field each, and the power that the norms sum."""
    planes = raster(volume)
    power = octant_power(planes)
    updates = [streaming_error(planes, k, m, config, elements) for k in rates.space for m in rates.time]
    phi, last = (torch.stack(found, dim=1) for found in ([u.mean(1) for u in updates], [u[:, -1] for u in updates]))
    theta = rates.densities(planes.shape[3], planes.shape[1])
    return Tiles(power_norm(power), theta, phi.to(torch.float64), last.to(torch.float64)), power


@dataclass(frozen=True)
class Example:
    """One tile in full. ``unit`` converts norm and rates from bins to physical rates.

    Attributes:
        tiles: the tile's norm and estimates.
        power: power of the bands up to one cycle a span, by frequency in y and x: the first slice of the norm.
        level, index: the tile.
        band: ``(f_s, f_t)``.
        unit: samples per pixel side and refreshes per second of one sample per tile side and span.
        realizable: least and greatest rate of the configuration in those units, in space and time.
    """

    tiles: Tiles
    power: Float[Tensor, "fy fx"]
    level: int
    index: int
    band: tuple[int, int]
    unit: tuple[float, float]
    realizable: tuple[tuple[float, float], tuple[float, float]]

    def summary(self) -> dict[str, Any]:
        """The ideal density ``(2 f_s, 2 f_t)`` (eq. 5.4), and the agreement of the estimates on the grid of rates with
        it."""
        bands = {tau: [int(f) for f in ideal_band(share_of_total(self.tiles.norm), tau)] for tau in _SHARES}
        return {
            "tile": {"level": self.level, "index": self.index},
            "variance": float(self.tiles.norm[0, -1, -1]),
            **self._density(*self.band),
            "other_tau": [{"tau": tau, **self._density(*band)} for tau, band in bands.items()],
            "realizable": dict(zip(("samples_per_pixel_side", "refreshes_per_s"), self.realizable, strict=True)),
        }

    def place(self, resolution_px: int) -> tuple[float, float, float]:
        """Left, top and width of the tile in a picture, pixels."""
        x, y = (int(axis) for axis in deinterleave(torch.tensor(self.index)))
        width = resolution_px / 2**self.level
        return x * width, y * width, width

    def _density(self, f_s: int, f_t: int) -> dict[str, float]:
        space, time = 2 * f_s * self.unit[0], 2 * f_t * self.unit[1]
        return {"f_s": f_s, "f_t": f_t, "samples_per_pixel_side": space, "refresh_ms": 1e3 / time}


def measure_example(options: SpectrumOptions, trace: Trace, task: Task) -> Example:
    """Renders the tile of the options at its high rate, and evaluates the estimate at every rate of the volume."""
    tsar, level = options.tsar, torch.tensor([options.tile_level])
    cell = torch.tensor([[int(place * 2**options.tile_level)] for place in options.tile_at])
    index = interleave(*cell) if options.tile_index is None else torch.tensor([options.tile_index])
    first_s, span_s, count = options.ideal_start_s, options.span_s, options.ideal_frames
    times_s = [first_s + span_s * frame / count for frame in range(count)]
    volume = tile_volume(trace, level, index, options.ideal_samples, times_s, task)
    space = tuple(1 << octave for octave in reversed(range((options.ideal_samples // FRAMELET_SIDE).bit_length())))
    time = tuple(1 << octave for octave in range(1, count.bit_length() - 2))
    tiles, power = measure(volume, Rates(space, time), tsar.error, tsar.elements_of(options.tile_level))
    f_s, f_t = ideal_band(share_of_total(tiles.norm), options.tau)
    per_picture = [FRAMELET_SIDE * 2.0**bound / tsar.resolution_px for bound in (tsar.level_min, tsar.level_max)]
    refreshes = [density / options.cycle_s() for density in tsar.temporal_bounds]
    return Example(
        tiles=tiles,
        power=power[0, :2].sum(0),
        level=options.tile_level,
        index=int(index),
        band=(int(f_s), int(f_t)),
        unit=(2.0**options.tile_level / tsar.resolution_px, 1.0 / span_s),
        realizable=((per_picture[0], per_picture[1]), (refreshes[0], refreshes[1])),
    )


def measure_input(options: SpectrumOptions, number: int, trace: Trace, duration_s: float, task: Task) -> Tiles:
    """Tiles of an input, drawn at random at four times."""
    rng = np.random.default_rng((options.tsar.seed, number))
    side, frames = options.agreement_samples, options.agreement_frames
    coarsest = side // FRAMELET_SIDE
    rates = Rates(tuple(coarsest >> octave for octave in range(3)), (2, 4, 8))
    elements = options.tsar.elements_of(options.agreement_level)
    found = []
    for start_s in (np.arange(_TIMES) + 0.5) * (duration_s - options.span_s) / _TIMES:
        times_s = start_s + np.arange(frames) * options.span_s / frames
        drawn = rng.choice(4**options.agreement_level, options.tiles_per_input // _TIMES, replace=False)
        for index in torch.from_numpy(drawn).split(_TILES_AT_ONCE):
            level = torch.full_like(index, options.agreement_level)
            volume = tile_volume(trace, level, index, side, times_s.tolist(), task)
            found.append(measure(volume, rates, options.tsar.error, elements)[0])
    return joined(found)


def joined(tiles: Sequence[Tiles]) -> Tiles:
    """Tiles measured at the same rates, one after the other."""
    norm, phi, last = (torch.cat([getattr(t, name) for t in tiles]) for name in ("norm", "phi", "phi_last"))
    return Tiles(norm, tiles[0].theta, phi, last)


def check_estimate(tiles: Mapping[str, Tiles], tau: float) -> dict[str, Any]:
    """The streaming estimate against the true direction.

    The agreement is given for all tiles, for those that change over the span, for one update alone, for each input, and
    for other thresholds: on the norm as a share of the tile's power, and on the norm itself, because the template also
    has an absolute level.
    """
    every = joined(list(tiles.values()))
    share, phi = share_of_total(every.norm), every.phi.numpy()
    f_s, f_t = ideal_band(share, tau)
    true, changes = every.true(share, tau), (f_t > 1).numpy()
    unresolved = [float((2 * f > limit).double().mean()) for f, limit in ((f_s, share.shape[2]), (f_t, share.shape[1]))]
    thresholds = [
        {"norm": name, "tau": value, **agreement(phi, every.true(norm, value))}
        for name, norm, values in (("share", share, _SHARES), ("variance", every.norm, _VARIANCES))
        for value in values
    ]
    return {
        "all": agreement(phi, true),
        "one_update": agreement(every.phi_last.numpy(), true),
        "changing_tiles": agreement(phi[changes], true[changes]) if changes.any() else None,
        "inputs": {name: agreement(t.phi.numpy(), t.true(share_of_total(t.norm), tau)) for name, t in tiles.items()},
        "thresholds": thresholds,
        "share_of_tiles_with_ideal_in_the_last_octave": dict(zip(("space", "time"), unresolved, strict=True)),
    }


def angle_deg(a: Floats, b: Floats) -> Floats:
    """Angle between vectors along the last axis, [0, 180] degrees; NaN where one of them is zero."""
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    angle = np.degrees(np.arctan2(np.abs(cross), (a * b).sum(-1)))
    return np.where((a == 0).all(-1) | (b == 0).all(-1), np.nan, angle)


def _figures(phi: Floats, true: Floats) -> Floats:
    """Per pair: angle, within 45 degrees, in the same quadrant, same sign in space, same sign in time."""
    angle = angle_deg(phi, true)
    same = phi * true >= 0  # a component that is already ideal lies on the border between two quadrants
    shares = np.stack((angle <= 45.0, same.all(-1), same[..., 0], same[..., 1]), axis=-1).astype(np.float64)
    return np.concatenate((angle[..., None], np.where(np.isnan(angle)[..., None], np.nan, shares)), axis=-1)


_NAMES = ("angle_median_deg", "share_within_45_deg", "share_same_quadrant", "share_sign_space", "share_sign_time")
ISOTROPIC = dict(zip(_NAMES, (90.0, 0.25, 0.25, 0.5, 0.5), strict=True))
"""Figures of directions that are drawn uniformly at random."""


def _summary(figures: Floats) -> Floats:
    """Median angle and means of the shares over the pairs that have a direction; NaN if none has."""
    known = figures[~np.isnan(figures[..., 0])]
    return np.array([np.median(known[:, 0]), *known[:, 1:].mean(0)]) if len(known) else np.full(len(_NAMES), np.nan)


def agreement(phi: Floats, true: Floats, seed: int = 0) -> dict[str, Any]:
    """Agreement of the estimated directions with the true ones.

    Args:
        phi, true: ``(tiles, rates, 2)``, components in space and time.
        seed: seed of resampling.

    Returns:
        Each figure with its 95 % interval (bootstrap over tiles, because the rates of a tile are not independent), and
        its value by chance (``permuted``): with the estimates permuted among the tiles at the same rate, which keeps
        the frequency of each sign. Also quartiles of the angle, tables of signs, and correlations. Pairs whose true
        vector is zero are counted and left out.
    """
    rng = np.random.default_rng(seed)
    tiles = len(phi)
    figures = _figures(phi, true)
    value = _summary(figures)
    resampled = np.stack([_summary(figures[rng.integers(0, tiles, tiles)]) for _ in range(_RESAMPLES)])
    permuted = np.stack([_summary(_figures(phi[rng.permutation(tiles)], true)) for _ in range(_SHUFFLES)])
    low, high = np.nanpercentile(resampled, INTERVAL, axis=0)
    chance_low, chance_high = np.percentile(permuted, INTERVAL, axis=0)
    found: dict[str, Any] = {
        name: {
            "value": value[i],
            "interval": (low[i], high[i]),
            "permuted": permuted[:, i].mean(),
            "permuted_interval": (chance_low[i], chance_high[i]),
            "isotropic": ISOTROPIC[name],
        }
        for i, name in enumerate(_NAMES)
    }
    angle = figures[..., 0]
    quartiles = np.nanpercentile(angle, (25.0, 50.0, 75.0))
    counts = {"tiles": tiles, "pairs": angle.size, "pairs_without_direction": int(np.isnan(angle).sum())}
    axes = {name: _axis(phi[..., i].ravel(), true[..., i].ravel()) for i, name in enumerate(("space", "time"))}
    return {**counts, **found, "angle_quartiles_deg": quartiles, **axes}


def _axis(phi: Floats, true: Floats) -> dict[str, Any]:
    """Table of signs (rows: the estimate asks for less, more; columns: the truth asks for less, nothing, more), and
    correlations, which are NaN if one side is constant."""
    rows, signs = (phi <= 0, phi > 0), (-1, 0, 1)
    table = [[int((row & (np.sign(true) == sign)).sum()) for sign in signs] for row in rows]
    constant = np.ptp(phi) == 0 or np.ptp(true) == 0
    pairs = {"pearson": (phi, true), "spearman": (rankdata(phi), rankdata(true))}
    found = {name: np.nan if constant else float(np.corrcoef(*xy)[0, 1]) for name, xy in pairs.items()}
    return {"signs": table, **found}
