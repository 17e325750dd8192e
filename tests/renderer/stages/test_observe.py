"""The compiled cache and its errors against the tensor operations that define them."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.stages.control import compiled_stages
from tests.oracles import pictures, runs
from tests.oracles.batches import make_batch
from tests.renderer.stages.alike import assert_same_cache
from tests.renderer.stages.builders import CYCLE_S, small
from tsar.cache import FrameletCache
from tsar.clock import StageTimer, fixed_clock
from tsar.config import TilingConfig
from tsar.stages import REFERENCE
from tsar.tiling import uniform
from tsar.types import SampleBatch


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), dead=st.sampled_from([0.0, 0.02, 0.5, 1.0]), times=st.sampled_from([1, 3, 1000]))
def test_the_cache_gives_up_the_same_slots(seed: int, dead: float, times: int) -> None:
    config = small(resolution_px=64, batch_size=8, cache_size=96, tiling=TilingConfig(1, 2, 16))
    observe, g = compiled_stages(config).observe, torch.Generator().manual_seed(seed)
    ours, theirs = FrameletCache(config), FrameletCache(config)
    slots = ours.level.shape[0]
    for _ in range(2 * slots // 8):
        selected = torch.randperm(16, generator=g)[:8].sort().values
        now = float(torch.randint(0, times, (), generator=g))
        batch = make_batch(uniform(2), selected, now, 0, config)
        color = torch.rand(8, 256, 3, generator=g)
        found = observe(batch, color, ours, config, StageTimer())
        wanted = REFERENCE.observe(batch, color, theirs, config, StageTimer())
        torch.testing.assert_close(found.errors.temporal, wanted.errors.temporal, rtol=0.0, atol=2e-5)
        flags = torch.rand(slots, generator=g) < dead
        for cache in (ours, theirs):
            cache.dead |= flags
    assert_same_cache(ours, theirs)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), torch.finfo(torch.float32).max])
def test_samples_that_are_not_finite_are_counted_and_repaired(value: float) -> None:
    config = small()
    ours, state = compiled_stages(config), runs.made("thesis", config).start()
    batch = state.due.at(0.0, 0, config)
    color = pictures.tracer(pictures.textured_motion)(batch).color
    color[5, 17, 1] = color[31, 255, 2] = value
    theirs = FrameletCache(config)
    found = ours.observe(batch, color, state.cache, config, StageTimer())
    wanted = REFERENCE.observe(batch, color, theirs, config, StageTimer())
    assert found.nonfinite == wanted.nonfinite == 2
    assert_same_cache(state.cache, theirs)
    torch.testing.assert_close(found.errors.spatial, wanted.errors.spatial, rtol=0.0, atol=2e-5)
    for record, display in runs.play(
        "thesis", config, lambda batch: SampleBatch(color), fixed_clock(CYCLE_S), 0.0, 0.05, compiled_stages(config)
    ):
        assert record.nonfinite == 2 and bool(torch.isfinite(display.image).all())


def test_colours_may_come_in_any_layout_and_precision() -> None:
    config = small()
    ours, state = compiled_stages(config), runs.made("thesis", config).start()
    batch = state.due.at(0.0, 0, config)
    grey = torch.rand(32, 256, 1, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).expand(-1, -1, 3)
    plain = grey.to(torch.float32).contiguous()
    caches = FrameletCache(config), FrameletCache(config)
    found, wanted = (
        ours.observe(batch, color, cache, config, StageTimer())
        for color, cache in zip((grey, plain), caches, strict=True)
    )
    assert torch.equal(found.errors.spatial, wanted.errors.spatial)
    assert_same_cache(*caches)


def test_larger_batches_than_the_configuration_says_are_refused() -> None:
    config = small()
    batch = make_batch(uniform(3), torch.arange(33), 0.0, 0, config)
    with pytest.raises(ValueError, match="expected at most 32 framelets, got 33"):
        compiled_stages(config).observe(batch, torch.zeros(33, 256, 3), FrameletCache(config), config, StageTimer())
