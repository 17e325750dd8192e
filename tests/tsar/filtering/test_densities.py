"""Densities in closed form, tilings that follow them, and credit."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from tests.tsar.filtering.test_tiles import covered
from tsar.filtering import densities
from tsar.filtering.densities import SPATIAL, TEMPORAL
from tsar.filtering.records import ELEMENT_PX, TILE_SIDE
from tsar.roots import cube_root

SIDE = 16  # elements


def needs(seed: int) -> tuple[Tensor, Tensor]:
    """Roughness and change of elements, over all magnitudes that occur."""
    random = torch.Generator().manual_seed(seed)
    coarse, stale = torch.rand(2, 1, SIDE, SIDE, generator=random, dtype=torch.float64)
    return 10.0 ** (5.0 * coarse - 6.0), 10.0 ** (6.0 * stale - 7.0)


@pytest.mark.parametrize("mean", [0.005, 1.0 / 32.0, 1.0])
def test_the_budget_is_spent_and_no_exchange_is_better(mean: float) -> None:
    """What an element would lose by less of the product is what others would gain by it: along the grid of all
    densities none lowers its error and the price of its samples together."""
    coarse, stale = needs(0)
    space, time = densities.best(coarse, stale, mean)
    assert float((space * time).mean()) == pytest.approx(mean, rel=1e-6)
    assert SPATIAL[0] <= space.min() and space.max() <= SPATIAL[1]
    assert TEMPORAL[0] <= time.min() and time.max() <= TEMPORAL[1]
    inside = (space > SPATIAL[0]) & (space < SPATIAL[1]) & (time > TEMPORAL[0]) & (time < TEMPORAL[1])
    price = (coarse / (space.square() * time))[inside]
    assert inside.any() and price.max() < price.min() * (1.0 + 1e-6), "one multiplier for all"
    grid_s = torch.logspace(-6.0, 2.0, 81, base=2.0, dtype=torch.float64)[:, None]
    grid_t = torch.logspace(-7.0, 0.0, 71, base=2.0, dtype=torch.float64)
    for a, b, s, t in zip(*(one.reshape(-1).tolist() for one in (coarse, stale, space, time)), strict=True):
        of_grid = a / grid_s + b / grid_t + price[0] * grid_s * grid_t
        assert a / s + b / t + price[0] * s * t <= float(of_grid.min()) * (1.0 + 1e-9)


def test_cube_roots_are_right() -> None:
    value = torch.logspace(-40.0, 40.0, 999, dtype=torch.float64)
    assert torch.allclose(cube_root(value) ** 3, value, rtol=1e-14, atol=0.0)
    assert cube_root(torch.tensor([8.0, 0.125, 27.0], dtype=torch.float64)).tolist() == pytest.approx([2.0, 0.5, 3.0])


def test_a_tiling_covers_the_image_once_and_holds_what_is_asked_for() -> None:
    space, _ = densities.best(*needs(1), 0.05)
    tiles = densities.tiling(space)
    assert (covered(tiles) == 1).all()
    asked = space[0] * ELEMENT_PX**2
    for level in reversed(tiles[:-1]):
        asked = 4.0 * torch.nn.functional.avg_pool2d(asked[None, None], 2)[0, 0]
        assert (asked[level] <= TILE_SIDE**2).all()


def test_tiles_are_refreshed_as_often_as_their_density_says() -> None:
    """Half of the image at a density of 1/4, half at 1/12: of 64 tiles, 32/4 + 32/12 fall due a cycle."""
    tiles = densities.tiling(torch.ones(1, SIDE, SIDE, dtype=torch.float64))
    tiles = [torch.zeros_like(level) for level in tiles[:3]] + [torch.ones_like(tiles[3]), torch.zeros_like(tiles[4])]
    temporal = torch.full((1, SIDE, SIDE), 1.0 / 12.0, dtype=torch.float64)
    temporal[..., : SIDE // 2] = 0.25
    credit = torch.rand(1, SIDE, SIDE, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    visits = torch.zeros(8, 8)
    for cycle in range(180):
        chosen, credit = densities.due(tiles, temporal, credit, 10 + (cycle % 3 > 0))
        assert sum(int(level.sum()) for level in chosen) == 10 + (cycle % 3 > 0)
        visits += chosen[3]
    assert (visits[:, :4] - 45).abs().max() <= 3 and (visits[:, 4:] - 15).abs().max() <= 3
