"""Which tiles are sampled: disjoint, as many as asked for, and those that gain most."""

from __future__ import annotations

import itertools

import pytest
import torch
from torch import Tensor

from tsar.filtering import tiles
from tsar.filtering.options import FilterOptions

LEVELS = 1, 2, 4


def covered(chosen: list[Tensor]) -> Tensor:
    """How many tiles lie on each of the finest cells."""
    finest = chosen[-1].shape[0]
    return sum(
        level.to(torch.int64).repeat_interleave(finest // len(level), 0).repeat_interleave(finest // len(level), 1)
        for level in chosen
    )  # type: ignore[return-value]


def total(chosen: list[Tensor], gain: list[Tensor]) -> float:
    return float(sum(level[pick].sum() for level, pick in zip(gain, chosen, strict=True)))


def all_choices() -> list[list[Tensor]]:
    """Every set of disjoint tiles of a tree of three levels, with whole quarters or their cells."""
    found = [[torch.ones(1, 1, dtype=torch.bool), *(torch.zeros(n, n, dtype=torch.bool) for n in LEVELS[1:])]]
    for quarters in itertools.product((False, True), repeat=4):
        middle = torch.tensor(quarters).reshape(2, 2)
        free = ~middle.repeat_interleave(2, 0).repeat_interleave(2, 1)
        cells = free.nonzero().tolist()
        for taken in itertools.product((False, True), repeat=len(cells)):
            if len(cells) > 8:
                break
            fine = torch.zeros(4, 4, dtype=torch.bool)
            for (row, column), use in zip(cells, taken, strict=True):
                fine[row, column] = use
            found.append([torch.zeros(1, 1, dtype=torch.bool), middle, fine])
    return found


@pytest.mark.parametrize("seed", range(4))
def test_no_other_disjoint_tiles_gain_more(seed: int) -> None:
    rng = torch.Generator().manual_seed(seed)
    gain = [torch.rand(n, n, generator=rng, dtype=torch.float64) * 16.0 / n**2 for n in LEVELS]
    chosen = tiles.best(gain, 5)
    count = sum(int(level.sum()) for level in chosen)
    assert covered(chosen).max() <= 1 and 0 < count <= 5
    rivals = [one for one in all_choices() if sum(int(level.sum()) for level in one) == count]
    assert total(chosen, gain) >= max(total(one, gain) for one in rivals) - 1e-12


def test_a_cycle_is_filled_up_with_free_tiles() -> None:
    gain = [torch.zeros(n, n, dtype=torch.float64) for n in LEVELS]
    gain[1][0, 0], gain[2][3, 3] = 5.0, 1.0
    chosen = tiles.filled_up(tiles.best(gain, 6), gain, 2, 6)
    assert sum(int(level.sum()) for level in chosen) == 6 and covered(chosen).max() == 1
    assert chosen[1][0, 0] and chosen[2][3, 3] and not chosen[2][:2, :2].any()


def test_what_is_unknown_is_sampled_coarsely_and_what_is_rough_finely() -> None:
    options, side = FilterOptions(), 64
    rate, speed = torch.full((1, side, side), 1e-5), torch.zeros(1, side, side)
    unknown = torch.full((1, side, side), 0.1)
    smooth = tiles.gains(unknown, torch.full((1, side, side), 1e-6), rate, speed, 0.01, options)
    rough = tiles.gains(unknown, torch.full((1, side, side), 1e-1), rate, speed, 0.01, options)
    kinds = tiles.spacings(side)
    assert kinds == (8.0, 4.0, 2.0, 1.0, 0.5)
    # a single coarse tile of a smooth image gains nearly as much as all fine ones; of a rough one it does not
    assert float(smooth[0].sum()) > 0.9 * float(smooth[3].sum())
    assert float(rough[0].sum()) < 0.3 * float(rough[3].sum())


def test_samples_are_of_less_use_where_surfaces_leave_soon() -> None:
    options, side = FilterOptions(), 64
    variance, roughness = torch.full((1, side, side), 0.1), torch.full((1, side, side), 1e-3)
    rate = torch.full((1, side, side), 1e-5)
    speed = torch.zeros(1, side, side)
    speed[..., 32:] = 1e3
    gain = tiles.gains(variance, roughness, rate, speed, 0.01, options)[3]
    assert torch.allclose(gain[:, 4:], gain[:, :4] * options.life_min_s / options.life_max_s)
