import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.oracles.batches import make_batch
from tsar.cache import EMPTY, FrameletCache
from tsar.config import TilingConfig, TsarConfig
from tsar.tiling import uniform

CONFIG = TsarConfig(batch_size=64, cache_size=2048)


def insert(cache, selected, time_s, value=0.0, level=4):
    batch = make_batch(uniform(level), torch.tensor(selected), time_s, 0, CONFIG)
    n = len(selected)
    return cache.insert(batch, torch.full((n, 256, 3), value), torch.full((n, 481), time_s))


def test_previous_returns_the_newest_of_the_same_tile_only():
    cache = FrameletCache(CONFIG)
    insert(cache, [3, 4], 1.0)
    insert(cache, [4], 2.0)
    state, known = cache.previous(torch.tensor([4, 4, 4, 5]), torch.tensor([3, 4, 9, 4]))
    assert known.tolist() == [True, True, False, False]
    assert state[0, 0] == 1.0 and state[1, 0] == 2.0


def test_dead_framelets_go_first_then_the_oldest():
    cache = FrameletCache(CONFIG)
    slots = len(cache.level)
    order = [insert(cache, list(range(64)), float(t)) for t in range(slots // 64)]
    assert bool((cache.level != EMPTY).all())
    cache.dead[order[7]] = True
    assert torch.equal(insert(cache, list(range(64)), 100.0), order[7])
    assert torch.equal(insert(cache, list(range(64)), 101.0), order[0])


@given(st.integers(0, 10_000))
def test_against_a_list_of_framelets(seed):
    """Batches of random tiles with random dead flags: the cache holds what a plain list would, and knows the newest."""
    config = TsarConfig(batch_size=8, resolution_px=64, cache_size=64, tiling=TilingConfig(level_min=1, level_max=2))
    cache, kept, latest = FrameletCache(config), [], {}
    g = torch.Generator().manual_seed(seed)
    for cycle in range(14):
        tiles = torch.randperm(16, generator=g)[:8].sort().values.tolist()
        batch = make_batch(uniform(2), torch.tensor(tiles), float(cycle), cycle, config)
        slots = cache.insert(batch, torch.full((8, 256, 3), float(cycle)), torch.full((8, 481), float(cycle)))
        if len(kept) + 8 > 64:
            kept.sort(key=lambda f: (not f["dead"], f["time"], f["slot"]))
            kept = kept[len(kept) + 8 - 64 :]
        kept += [{"tile": t, "time": cycle, "dead": False, "slot": int(s)} for t, s in zip(tiles, slots, strict=True)]
        latest.update(dict.fromkeys(tiles, cycle))
        for framelet in kept:
            framelet["dead"] = bool(torch.rand((), generator=g) < 0.1) or framelet["dead"]
            cache.dead[framelet["slot"]] = framelet["dead"]
        times = sorted(f["time"] for f in kept)
        assert sorted(cache.time_s[cache.level != EMPTY].tolist()) == times
        assert len({f["slot"] for f in kept}) == len(kept)
    state, known = cache.previous(torch.full((16,), 2), torch.arange(16))
    for tile in range(16):
        # A tile whose newest framelet was evicted is forgotten with it, though an older one may remain.
        held = any(f["tile"] == tile and f["time"] == latest.get(tile) for f in kept)
        assert bool(known[tile]) == held and (not held or state[tile, 0] == latest[tile])


def test_eviction_forgets_only_what_it_evicts():
    cache = FrameletCache(CONFIG)
    insert(cache, [0], 0.0)
    newer = insert(cache, [0], 1.0)
    cache.dead[:] = True
    cache.dead[newer] = False
    insert(cache, list(range(1, 65)), 2.0)
    _, known = cache.previous(torch.tensor([4]), torch.tensor([0]))
    assert known.item()
