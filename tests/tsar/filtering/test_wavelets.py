"""Roughness and change by wavelets, on signals whose power is known."""

from __future__ import annotations

from dataclasses import replace

import torch

from tests.tsar.filtering.test_filter import Counting
from tsar import haar
from tsar.filtering import wavelets
from tsar.filtering.records import Estimates
from tsar.morton import morton_to_raster

SIDE = 64


def test_the_roughness_of_a_brownian_surface_is_its_semivariance() -> None:
    """Surfaces with semivariance as far as samples are apart, by the exact root of their covariance."""
    raster = morton_to_raster(8)
    place = torch.stack((raster % 8, raster // 8), dim=1).to(torch.float64)
    from_corner = torch.cdist(place, torch.full((1, 2), -1.0, dtype=torch.float64))
    covariance = from_corner + from_corner.T - torch.cdist(place, place)
    root = torch.linalg.cholesky(covariance)
    white = torch.randn(6000, 64, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    surface = (root @ white).to(torch.float32)
    assert abs(float(wavelets.semivariance_of(surface).mean()) - 1.0) < 0.03


def test_octants_are_those_of_the_transform() -> None:
    """The temporal octants of two fields are the low ones of their difference."""
    first, second = torch.rand(2, 5, 64, generator=torch.Generator().manual_seed(1))
    nothing = torch.zeros(5, haar.state_size(64))
    _, state = haar.transform(first, nothing, torch.zeros(5, dtype=torch.bool))
    octaves, _ = haar.transform(second, state, torch.ones(5, dtype=torch.bool))
    low, sides, _ = wavelets.octants((second - first)[..., None])[0]
    assert torch.allclose(low, octaves[0].hhg.square(), atol=1e-6)
    assert torch.allclose(sides, octaves[0].hgg.square() + octaves[0].ghg.square(), atol=1e-6)


def test_change_is_beyond_what_is_expected_and_noise_is_not() -> None:
    generator = torch.Generator().manual_seed(2)
    grey = torch.full((3, SIDE, SIDE), 0.25)
    known = replace(
        Estimates.empty(SIDE), color=grey, inverse=torch.zeros(1, SIDE, SIDE),
        time_s=torch.zeros(1, SIDE, SIDE, dtype=torch.float64),
    )  # fmt: skip
    pixel = (torch.arange(64)[:, None] * 64 + torch.arange(64)).reshape(-1)
    count = torch.ones(1, SIDE, SIDE)
    deviation = (0.8 * known.roughness.mean()) ** 0.5
    noise = 0.5 + deviation * torch.randn(64, 64, 3, generator=generator)
    residual, expected = wavelets.residuals(known, noise, pixel, count)
    assert (residual < expected).float().mean() > 0.97
    residual, expected = wavelets.residuals(known, noise + 0.2, pixel, count)
    assert (residual > expected).all() and abs(float(residual.mean()) - 0.04) < 0.005


def test_what_is_not_known_says_nothing_of_change() -> None:
    nothing = Estimates.empty(SIDE)
    pixel = torch.full((64 * 64,), SIDE * SIDE)
    residual, expected = wavelets.residuals(nothing, torch.rand(64, 64, 3), pixel, torch.zeros(1, SIDE, SIDE))
    assert not residual.any() and not expected.any()


def test_the_price_of_a_sample_holds_the_wavelets() -> None:
    """In place of the 24 for semivariance and the pixel's residual, with the 100 that the price leaves."""
    count, color = Counting(), torch.rand(64, 64, 3)
    nothing, pixel = Estimates.empty(SIDE), torch.arange(64 * 64)
    with count:
        wavelets.semivariance_of(color)
        wavelets.residuals(nothing, color, pixel, torch.ones(1, SIDE, SIDE))
    assert 40.0 < count.operations / 64**2 <= 100.0
