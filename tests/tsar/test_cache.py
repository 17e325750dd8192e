import torch

from tsar.cache import FrameletCache
from tsar.config import TsarConfig
from tsar.selection import make_batch
from tsar.tiling import uniform

CONFIG = TsarConfig(batch_size=64, cache_size=2048)


def insert(cache, selected, time_s, value=0.0, level=4):
    batch = make_batch(uniform(level), torch.tensor(selected), time_s, 0, CONFIG)
    n = len(selected)
    return cache.insert(batch, torch.full((n, 256, 3), value), torch.full((n, 340), time_s))


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
    assert bool(cache.occupied.all())
    cache.dead[order[7]] = True
    assert torch.equal(insert(cache, list(range(64)), 100.0), order[7])
    assert torch.equal(insert(cache, list(range(64)), 101.0), order[0])


def test_eviction_forgets_only_what_it_evicts():
    cache = FrameletCache(CONFIG)
    insert(cache, [0], 0.0)
    newer = insert(cache, [0], 1.0)
    cache.dead[:] = True
    cache.dead[newer] = False
    insert(cache, list(range(1, 65)), 2.0)
    _, known = cache.previous(torch.tensor([4]), torch.tensor([0]))
    assert known.item()
