"""Compiled reconstruction against the tensor operations, and against the slow definition."""

from __future__ import annotations

import copy

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.stages.reconstruction import Reconstructor
from tests.oracles import pictures
from tests.oracles.batches import make_batch
from tests.oracles.reconstruction_slow import slow_reconstruct
from tests.renderer.stages.builders import CONFIGS, CYCLE_S, moments, small
from tsar.cache import EMPTY, FrameletCache
from tsar.config import ReconstructionConfig, TilingConfig, TsarConfig
from tsar.reconstruction import Reconstruction, reconstruct
from tsar.tiling import build, uniform

TOLERANCE = 1e-5
"""Relative: the reference rounds samples to 20 bits before it interpolates."""


def config_of(support: int = 9, resolution: int = 64, level_max: int = 4, **more) -> TsarConfig:
    tiling = TilingConfig(level_min=1, level_max=level_max, tile_count_max=4**level_max)
    return TsarConfig(
        batch_size=4,
        resolution_px=resolution,
        cache_size=512,
        tiling=tiling,
        reconstruction=ReconstructionConfig(support),
        **more,
    )


def fill(cache, config, tiling, picture, time_s, selected=None):
    selected = torch.arange(tiling.tile_count) if selected is None else torch.tensor(selected)
    batch = make_batch(tiling, selected, time_s, 0, config)
    color = pictures.tracer(picture)(batch).color.contiguous()
    cache.insert(batch, color, torch.zeros(len(selected), cache.coefficients.shape[1]))
    return [(int(lv), int(ix), time_s, c) for lv, ix, c in zip(batch.level, batch.index, color, strict=True)]


def assert_same(found: Reconstruction, wanted: Reconstruction, ours: FrameletCache, theirs: FrameletCache) -> None:
    torch.testing.assert_close(found.image, wanted.image, rtol=TOLERANCE, atol=1e-6)
    assert torch.equal(found.sample_map.newest_s, wanted.sample_map.newest_s)
    assert torch.equal(found.sample_map.level, wanted.sample_map.level)
    assert torch.equal(ours.dead, theirs.dead) and found.overdraw == pytest.approx(wanted.overdraw)


@pytest.mark.parametrize("name", CONFIGS)
def test_images_of_a_run_agree_with_the_reference(name: str) -> None:
    config = CONFIGS[name]
    reconstructor, dead = Reconstructor(config, 2), 0
    for moment in moments(config, 40, 2):
        ours, theirs = copy.deepcopy(moment.after.cache), copy.deepcopy(moment.after.cache)
        for cache in (ours, theirs):
            cache.dead[cache.level != EMPTY] = False
        found, wanted = reconstructor.reconstruct(ours, config, CYCLE_S), reconstruct(theirs, config, CYCLE_S)
        assert_same(found, wanted, ours, theirs)
        dead += int(theirs.dead[theirs.level != EMPTY].sum())
    assert dead > 0, "nothing was ever out of date"


@settings(max_examples=30)
@given(
    seed=st.integers(0, 10_000),
    support=st.sampled_from([1, 5, 33]),
    cycle_s=st.sampled_from([1e-4, 0.05, 10.0]),
    side=st.sampled_from([16, 32]),
)
def test_any_cache_gives_the_image_of_the_reference(seed: int, support: int, cycle_s: float, side: int) -> None:
    """Random tilings, random parts of them, random times, more than the cache holds; some leave holes."""
    config = config_of(support, framelet_side=side)
    reconstructor, g = Reconstructor(config), torch.Generator().manual_seed(seed)
    ours, theirs = FrameletCache(config), FrameletCache(config)
    for _ in range(3):
        tiling = build(torch.rand(256, generator=g, dtype=torch.float64).repeat_interleave(64) ** 4, config)
        count = 1 + tiling.tile_count * (seed % 3) // 2
        chosen = torch.randperm(tiling.tile_count, generator=g)[:count].sort().values
        batch = make_batch(tiling, chosen, float(torch.rand((), generator=g)), 0, config)
        color = 0.2 + 0.6 * torch.rand(len(chosen), side**2, 3, generator=g)
        for cache in (ours, theirs):
            cache.insert(batch, color, torch.zeros(len(chosen), cache.coefficients.shape[1]))
        found, wanted = reconstructor.reconstruct(ours, config, cycle_s), reconstruct(theirs, config, cycle_s)
        assert_same(found, wanted, ours, theirs)


@pytest.mark.parametrize("support", [1, 5])
def test_against_the_slow_definition(support: int) -> None:
    """Tiles of four levels and four ages, overlapping."""
    config = config_of(support)
    cache = FrameletCache(config)
    framelets = fill(cache, config, uniform(1), pictures.textured_motion, 0.0)
    framelets += fill(cache, config, uniform(2), pictures.textured_motion, 0.1, [0, 5, 6, 11])
    framelets += fill(cache, config, uniform(3), pictures.textured_motion, 0.2, [3, 9, 21, 22, 60])
    framelets += fill(cache, config, uniform(4), pictures.textured_motion, 0.3, [12, 13, 90, 255])
    image = Reconstructor(config, 2).reconstruct(cache, config, 0.05).image
    x, y = torch.randint(0, 64, (2, 250), generator=torch.Generator().manual_seed(0)).tolist()
    expected = slow_reconstruct(framelets, 64, 16, support, 0.05, list(zip(x, y, strict=True)))
    assert torch.allclose(image[y, x].to(torch.float64), expected, atol=2e-4)


def test_nothing_cached_is_black_and_half_cached_is_filled_by_the_reference() -> None:
    config = config_of()
    reconstructor, cache = Reconstructor(config), FrameletCache(config)
    assert not reconstructor.reconstruct(cache, config, 0.1).image.any()
    fill(cache, config, uniform(2), pictures.constant, 0.0, [0, 7])
    other = copy.deepcopy(cache)
    found, wanted = reconstructor.reconstruct(cache, config, 0.1), reconstruct(other, config, 0.1)
    assert torch.equal(found.image, wanted.image) and found.image.min() > 0.39


@pytest.mark.parametrize("resolution", [64, 512])
def test_images_do_not_depend_on_the_number_of_threads(resolution: int) -> None:
    config = small(resolution_px=resolution, batch_size=64)
    cache = next(moments(config, 24, 1)).after.cache
    images = [
        Reconstructor(config, threads).reconstruct(copy.deepcopy(cache), config, CYCLE_S).image
        for threads in (1, 2, 3, 64)
    ]
    assert all(torch.equal(image, images[0]) for image in images[1:])


def test_images_stay_as_they_were_when_the_next_is_made() -> None:
    config = small()
    reconstructor, made = Reconstructor(config), []
    for moment in moments(config, 8, 4):
        shown = reconstructor.reconstruct(moment.after.cache, config, CYCLE_S)
        made.append((shown, copy.deepcopy(shown)))
    for shown, kept in made:
        assert torch.equal(shown.image, kept.image) and torch.equal(shown.sample_map.newest_s, kept.sample_map.newest_s)
    assert not torch.equal(made[-1][0].image, made[-2][0].image)
