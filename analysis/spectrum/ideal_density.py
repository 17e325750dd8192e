"""Ideal sample density Θ* of tiles from volumes rendered at a high rate.

A *volume* holds the compressed luminance of a tile: ``side * side`` samples in Morton order at each of ``frames``
times. The scene is sampled as the adaptive renderer samples it: points on a regular grid, without a filter.

Source: Stephens 2011, sec. 5.1.2.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from analysis.command.progress import Task
from tsar.error import compressed_luminance
from tsar.morton import raster_to_morton
from tsar.selection import sample_positions
from tsar.types import FrameletBatch, Trace


def tile_volume(
    trace: Trace,
    level: Int64[Tensor, " n"],
    index: Int64[Tensor, " n"],
    side: int,
    times_s: Sequence[float],
    task: Task,
) -> Float[Tensor, "n t samples"]:
    """Renders tiles with ``side * side`` samples each at every time; each time is one batch and one step of the
    task."""
    position = sample_positions(level, index, side)
    volume = torch.empty(position.shape[0], len(times_s), side * side)
    for frame, time_s in enumerate(times_s):
        volume[:, frame] = compressed_luminance(trace(FrameletBatch(level, index, position, time_s)).color)
        task.advance()
    return volume


def raster(volume: Float[Tensor, "n t samples"]) -> Float[Tensor, "n t y x"]:
    """Samples of each time in rows."""
    side = round(volume.shape[2] ** 0.5)
    return volume[..., raster_to_morton(side)].reshape(*volume.shape[:2], side, side)


def octant_power(volume: Float[Tensor, "n t y x"], windowed: bool = True) -> Float[Tensor, "n ft fy fx"]:
    """Power of the 3-D Fourier transform ``F``, for frequencies 0 to N/2: ``F̄²(f) = Σ |F(±f_t, ±f_y, ±f_x)|²``.

    The power sums to the (weighted) variance of the volume. The mean is subtracted and a Hann window is applied along
    all three axes: neither a tile nor a span of time is periodic, and the jump between its ends would leak power into
    every band, falling only with the square of frequency, as if the tile were full of detail. The window spreads a
    frequency over its two neighbours and gives less weight to the border of the tile.

    Source: Stephens 2011, eq. 5.1.

    Deviation: eq. 5.1 counts frequencies from 1 on all axes, and so leaves out everything that is constant along one of
    them: static content, and every vertical or horizontal edge. Frequency 0 is kept here, except for the mean itself.
    """
    axes = volume.shape[1:]
    hann = [torch.hann_window(n, dtype=volume.dtype) if windowed else torch.ones(n, dtype=volume.dtype) for n in axes]
    window = hann[0][:, None, None] * hann[1][:, None] * hann[2]
    mean = (volume * window).sum((1, 2, 3), keepdim=True) / window.sum()
    power = torch.fft.rfftn((volume - mean).mul_(window), dim=(1, 2, 3)).abs().square_()
    power[..., 1:-1] *= 2.0  # negative frequencies of a real signal along x, which rfftn leaves out
    power = _fold(_fold(power, 1), 2).to(torch.float64)
    power[:, 0, 0, 0] = 0.0
    return power / (window.square().sum(dtype=torch.float64) * window.numel())


def _fold(power: Tensor, dim: int) -> Tensor:
    """Adds negative frequencies to positive ones along an axis of even length."""
    half = power.shape[dim] // 2
    folded = power.narrow(dim, 0, half + 1).clone()
    folded.narrow(dim, 1, half - 1).add_(power.narrow(dim, half + 1, half - 1).flip(dim))
    return folded


def power_norm(power: Float[Tensor, "n ft fy fx"]) -> Float[Tensor, "n t s"]:
    """Power in the bands up to ``s`` along x and y and up to ``t`` along time, at ``[t - 1, s - 1]``:
    ``Norm_ps(s, t) = Σ F̄²(f_t, f_y, f_x)`` over ``f_x <= s``, ``f_y <= s``, ``f_t <= t``.

    Source: Stephens 2011, eq. 5.2.
    """
    side = power.shape[3]
    bins = torch.arange(side)
    shell = torch.maximum(bins[:, None], bins).reshape(-1)
    shells = power.new_zeros(*power.shape[:2], side).index_add_(2, shell, power.flatten(2))
    return shells.cumsum(1).cumsum(2)[:, 1:, 1:]


def share_of_total(norm: Float[Tensor, "n t s"]) -> Float[Tensor, "n t s"]:
    """The norm as a share of all power; 0 everywhere for a constant tile."""
    return norm / norm[:, -1:, -1:].clamp(min=torch.finfo(norm.dtype).tiny)


def octave_gain(norm: Float[Tensor, "n t s"]) -> Float[Tensor, "n t s"]:
    """Magnitude of the norm's gradient on octave axes, which is the gain of one more octave of the rates:
    ``hypot(Norm_ps(2 s, t) - Norm_ps(s, t), Norm_ps(s, 2 t) - Norm_ps(s, t))``.

    Differences are taken to the band twice as wide, or to the edge of the volume's spectrum. On octave axes a threshold
    means the same at every rate, size and length of the volume. Source: Stephens 2011, eq. 5.3.
    """
    doubled = [(2 * torch.arange(1, n + 1)).clamp(max=n) - 1 for n in norm.shape[1:]]
    return torch.hypot(norm[:, doubled[0]] - norm, norm[:, :, doubled[1]] - norm)


def ideal_band(norm: Float[Tensor, "n t s"], tau: float) -> tuple[Int64[Tensor, " n"], Int64[Tensor, " n"]]:
    """``(f_s, f_t)``, in cycles per tile and per span: the cheapest band (least ``f_s² f_t``) from which on no wider
    band gains more than ``tau`` an octave. The ideal density is ``Θ* = (2 f_s, 2 f_t)`` samples.

    Source: Stephens 2011, eq. 5.3–5.4.

    Deviation: eq. 5.3 asks where the gradient's magnitude crosses ``tau``. That is a curve, and the magnitude may also
    lie below ``tau`` in an empty band before the signal's power begins. Scale and ``tau`` are not printed.
    """
    worst = octave_gain(norm).flip(1, 2).cummax(1).values.cummax(2).values.flip(1, 2)
    t, s = (torch.arange(1, n + 1) for n in norm.shape[1:])
    cost = torch.where(worst <= tau, t[:, None] * s**2, torch.iinfo(torch.int64).max)
    cheapest = cost.flatten(1).argmin(1)
    return cheapest % len(s) + 1, cheapest // len(s) + 1
