"""Ideal densities of made-up signals."""

from __future__ import annotations

from math import pi

import pytest
import torch

from analysis.command.progress import Task
from analysis.spectrum.ideal_density import (
    ideal_band,
    octant_power,
    octave_gain,
    power_norm,
    raster,
    share_of_total,
    tile_volume,
)
from tests.analysis.signals import disk, flat_band, noise, separable
from tsar.error import compressed_luminance
from tsar.morton import deinterleave
from tsar.selection import sample_positions
from tsar.types import FrameletBatch


def band(volume: torch.Tensor, tau: float = 0.01) -> tuple[list[int], list[int]]:
    f_s, f_t = ideal_band(share_of_total(power_norm(octant_power(volume))), tau)
    return f_s.tolist(), f_t.tolist()


@pytest.mark.parametrize("windowed", [False, True])
def test_octants_and_norm_against_loops(windowed: bool) -> None:
    frames, side = 4, 8
    volume = noise(1, frames, side, side) + 3.0
    axes = [torch.hann_window(n, dtype=torch.float64) if windowed else torch.ones(n) for n in (frames, side, side)]
    window = torch.einsum("t,y,x->tyx", *[axis.double() for axis in axes])
    mean = (volume[0] * window).sum() / window.sum()
    transform = torch.fft.fftn((volume[0] - mean) * window).abs().square() / (window.square().sum() * window.numel())
    expected = torch.zeros(frames // 2 + 1, side // 2 + 1, side // 2 + 1, dtype=torch.float64)
    for z in range(frames):
        for y in range(side):
            for x in range(side):
                if (z, y, x) != (0, 0, 0):
                    expected[min(z, frames - z), min(y, side - y), min(x, side - x)] += transform[z, y, x]
    power = octant_power(volume, windowed)
    torch.testing.assert_close(power[0], expected)
    norm = power_norm(power)[0]
    assert norm.shape == (frames // 2, side // 2)
    for t in range(1, frames // 2 + 1):
        for s in range(1, side // 2 + 1):
            total = sum(expected[z, y, x] for z in range(t + 1) for y in range(s + 1) for x in range(s + 1))
            assert norm[t - 1, s - 1] == pytest.approx(float(total))


def test_all_power_is_the_variance() -> None:
    volume = noise(2, 8, 16, 16)
    total = power_norm(octant_power(volume, windowed=False))[:, -1, -1]
    torch.testing.assert_close(total, volume.flatten(1).var(1, correction=0))
    windowed = power_norm(octant_power(noise(1, 32, 64, 64)))[:, -1, -1]
    assert float(windowed) == pytest.approx(1.0, rel=0.03)


@pytest.mark.parametrize(("f_s", "f_t"), [(3, 9), (8, 2), (5, 5), (12, 14)])
def test_ideal_density_of_a_band_limited_signal(f_s: int, f_t: int) -> None:
    """Exact without a window; with it a frequency spreads over its neighbours."""
    volume = separable(64, 64, f_s, f_t)
    norm = share_of_total(power_norm(octant_power(volume, windowed=False)))
    assert [int(f) for f in ideal_band(norm, 1e-9)] == [f_s, f_t]
    found_s, found_t = band(volume)
    assert abs(found_s[0] - f_s) <= 1 and abs(found_t[0] - f_t) <= 1


def test_power_above_an_empty_band_is_found() -> None:
    """A pure tone has no power below it, where the gradient is zero too."""
    x, t = torch.arange(64, dtype=torch.float64) / 64, torch.arange(32, dtype=torch.float64) / 32
    tone = torch.cos(2 * pi * 10 * x) * torch.cos(2 * pi * 6 * t)[:, None, None].expand(32, 64, 1)
    f_s, f_t = band(tone[None])
    assert f_s[0] in (10, 11) and f_t[0] in (6, 7)


def test_still_flickering_and_constant_tiles() -> None:
    still = flat_band(64, 12, 0).outer(flat_band(64, 12, 1)).expand(1, 32, 64, 64)
    flicker = flat_band(32, 8, 2)[:, None, None].expand(1, 32, 64, 64)
    f_s, f_t = band(torch.cat((still, flicker, torch.full_like(flicker, 0.3))))
    assert f_t[0] == 1 and abs(f_s[0] - 12) <= 1
    assert f_s[1] == 1 and abs(f_t[1] - 8) <= 1
    assert (f_s[2], f_t[2]) == (1, 1)


def test_an_edge_along_an_axis_counts() -> None:
    """Eq. 5.1 as printed leaves it out: it is constant along y and time."""
    edge = (torch.arange(64) > 30).double().expand(1, 16, 64, 64)
    f_s, f_t = band(edge)
    assert f_s[0] > 4 and f_t[0] == 1


def test_what_moves_faster_needs_a_higher_rate() -> None:
    place, time = torch.arange(64, dtype=torch.float64) / 64, torch.arange(64, dtype=torch.float64) / 64
    picture = [torch.sin(2 * pi * 4 * (place[None] - v * time[:, None]))[:, None].expand(64, 64, 64) for v in (0, 1, 3)]
    f_s, f_t = band(torch.stack(picture))
    assert max(f_s) - min(f_s) <= 1 and f_t[0] == 1
    assert abs(f_t[1] - 4) <= 1 and abs(f_t[2] - 12) <= 1


def test_gain_and_band_by_hand() -> None:
    """Two bins in time, four in space; nothing is gained in time."""
    norm = torch.tensor([0.6, 0.9, 0.95, 1.0], dtype=torch.float64).expand(1, 2, 4)
    torch.testing.assert_close(octave_gain(norm)[0, 0], torch.tensor([0.3, 0.1, 0.05, 0.0], dtype=torch.float64))
    expected = {0.35: 1, 0.2: 2, 0.07: 3, 0.01: 4}
    assert {tau: int(ideal_band(norm, tau)[0]) for tau in expected} == expected
    assert int(ideal_band(norm, 0.01)[1]) == 1


def test_threshold_means_the_same_at_any_rate() -> None:
    """The same signal, sampled twice as densely and for twice as long, has the same ideal density."""
    coarse, fine, long = separable(64, 32, 6, 5), separable(128, 64, 6, 5), separable(64, 64, 6, 10)
    assert band(coarse) == band(fine)
    f_s, f_t = band(long)
    assert f_s == band(coarse)[0] and abs(f_t[0] - 10) <= 1


def test_volumes_hold_compressed_luminance_of_the_tile() -> None:
    level, index = torch.tensor([2, 2]), torch.tensor([0, 9])
    task = Task()
    volume = tile_volume(disk, level, index, 16, [0.0, 0.5], task)
    assert volume.shape == (2, 2, 256) and task.done == 2
    position = sample_positions(level, index, 16)
    batch = FrameletBatch(level, index, position, 0.5)
    torch.testing.assert_close(volume[:, 1], compressed_luminance(disk(batch).color))
    planes = raster(volume)
    assert planes.shape == (2, 2, 16, 16)
    x, y = deinterleave(torch.tensor(37))
    assert planes[1, 1, y, x] == volume[1, 1, 37]
