"""Extreme tilings, by both sets of stages: the coarsest, the deepest, and every finest tile at once."""

from __future__ import annotations

import pytest
import torch

from renderer.stages.control import Control
from tests.renderer.stages.alike import assert_same_request, decided_by_reference, same_tiling
from tests.renderer.stages.twins import differences
from tsar.clock import StageTimer
from tsar.config import ResponseConfig, TilingConfig, TsarConfig
from tsar.morton import deinterleave, first_node, floor_log2, interleave, tile_interval, tile_mean
from tsar.selection import initial_history, sample_positions
from tsar.tiling import build, uniform
from tsar.types import Densities, Errors

LAST = 2**16 - 1


def test_the_curve_over_all_of_its_cells() -> None:
    """65,536 x 65,536: its ends, its diagonals, and a million places."""
    g = torch.Generator().manual_seed(2)
    x, y = torch.randint(0, LAST + 1, (2, 1_000_000), generator=g)
    ends = torch.tensor([0, 1, LAST - 1, LAST, 2**15, 2**15 - 1])
    x = torch.cat((x, *(ends.repeat_interleave(6), ends)))
    y = torch.cat((y, *(ends.repeat(6), ends.flip(0))))
    index = interleave(x, y)
    assert int(index.max()) == 2**32 - 1 and int(index.min()) == 0
    assert all(torch.equal(one, other) for one, other in zip(deinterleave(index), (x, y), strict=True))
    corner = torch.tensor([LAST])
    assert int(interleave(corner, corner)) == 2**32 - 1 and int(interleave(0 * corner, corner)) == 2 * (2**32 - 1) // 3
    assert int(first_node(16)) == sum(4**level for level in range(16))
    assert floor_log2(index + 2**32).tolist() == [32] * index.numel(), "kd indices of depth 32"
    assert tile_interval(torch.tensor([0, 16]), torch.tensor([0, 2**32 - 1]), 16)[1].tolist() == [2**32] * 2


def test_samples_of_the_finest_grid_are_exact() -> None:
    """The centres of cells are odd multiples of half their width: exact to level 12 of tiles of 16 x 16 samples, where
    65,536 cells lie along a side."""
    for level, exact in ((9, 65536), (11, 65536), (12, 131072)):
        last = torch.tensor([4**level - 1])
        place = sample_positions(torch.tensor([level]), last, 16).to(torch.float64)
        assert bool((place < 1.0).all()) and bool(((place * exact) % 1.0 == 0.0).all())
        assert place.reshape(-1, 2).unique(dim=0).shape[0] == 256


DEEP = TsarConfig(
    batch_size=16,
    resolution_px=1024,
    sdf_side=512,
    tiling=TilingConfig(level_min=1, level_max=9),
    response=ResponseConfig(temporal_min=1e-6),
)
"""All levels that there are."""


def decided(densities: Densities, history: torch.Tensor, config: TsarConfig):
    """By the compiled stages, without a response."""
    none = Errors(*torch.zeros(2, config.sdf_side**2).unbind(0))
    return Control(config).decide(densities, none, history, config, StageTimer())


@pytest.mark.parametrize("element", [0, 4**9 - 1, 123_457])
def test_the_greatest_depth(element: int) -> None:
    """One element asks for all density: tiles of every level surround it, including tiles of one element."""
    spatial = torch.full((512**2,), DEEP.spatial_bounds[0], dtype=torch.float64)
    spatial[element] = 1e6
    densities, history = Densities(spatial, torch.full_like(spatial, 1e-6)), initial_history(DEEP)
    found, wanted = decided(densities, history, DEEP), decided_by_reference(densities, history, DEEP)
    assert same_tiling(found.tiling, wanted.tiling)
    assert_same_request(found.due, wanted.due)
    level, index = found.tiling.level, found.tiling.index
    assert set(level.tolist()) == set(range(1, 10))
    first, last = tile_interval(level, index, 9)
    assert int(first[0]) == 0 and int(last[-1]) == 4**9 and torch.equal(first[1:], last[:-1])
    around = int(((first <= element) & (element < last)).nonzero())
    assert int(level[around]) == 9
    mean = tile_mean(spatial, level, index, 9)
    assert float(mean[around]) == 1e6 and float(mean[level == 9].min()) == DEEP.spatial_bounds[0]


def test_one_tile_is_the_mean_of_all() -> None:
    """The tiling of one tile, which no configuration has: a batch of one is of four."""
    g = torch.Generator().manual_seed(1)
    field = 10.0 ** (12.0 * torch.rand(4**5, generator=g, dtype=torch.float64) - 6.0)
    whole = uniform(0)
    assert whole.tile_count == 1 and float(tile_mean(field, whole.level, whole.index, 5)) == pytest.approx(
        float(field.mean()), rel=1e-14
    )
    with pytest.raises(ValueError, match=r"tiling.level_min: expected between 1 and 9, got 0"):
        TilingConfig(level_min=0)


def full(level_min: int, level_max: int, **more) -> TsarConfig:
    """A batch of every finest tile."""
    count = 4**level_max
    return TsarConfig(
        batch_size=count, resolution_px=128, sdf_side=32, cache_size=count,
        tiling=TilingConfig(level_min=level_min, level_max=level_max, tile_count_max=count), **more,
    )  # fmt: skip


FULL = {"coarsest": full(1, 1), "all finest": full(1, 4), "one level": full(4, 4)}


@pytest.mark.parametrize("name", FULL)
def test_a_batch_of_the_whole_tiling_refreshes_every_tile_in_every_cycle(name: str) -> None:
    config = FULL[name]
    spatial = torch.full((32**2,), config.spatial_bounds[1], dtype=torch.float64)
    densities, history = Densities(spatial, torch.ones_like(spatial)), initial_history(config)
    assert build(spatial, config).tile_count == 4**config.level_max == config.batch_size
    for _ in range(5):
        found, wanted = decided(densities, history, config), decided_by_reference(densities, history, config)
        assert_same_request(found.due, wanted.due)
        assert found.due.selected.tolist() == list(range(config.batch_size))
        assert float(found.due.history.abs().max()) <= 1.0
        history = found.due.history


@pytest.mark.parametrize("name", FULL)
def test_both_sets_of_stages_agree_on_whole_tilings(name: str) -> None:
    assert sorted(set(differences(FULL[name], 3, 3))) == []
