"""The controller that sees the answer: its choice against every other, and what it gains."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.oracles import pictures, runs
from tests.oracles.batches import make_batch
from tsar.cache import FrameletCache
from tsar.clock import fixed_clock
from tsar.config import TilingConfig, TsarConfig
from tsar.estimators import state_size
from tsar.policies import oracle
from tsar.policies.oracle import Oracle
from tsar.reconstruction import reconstruct
from tsar.tiling import uniform
from tsar.types import SampleBatch, ShownImage

CYCLE, WARMUP = 0.02, 4
CONFIG = TsarConfig(
    batch_size=16, resolution_px=64, sdf_side=32, warmup_cycles=WARMUP, tiling=TilingConfig(tile_count_max=64)
)
EDGE = pictures.moving_edge(0.5, 0.2)


# --- the choice ------------------------------------------------------------------------------------------------------


def every_set(benefit, level, index):
    """Size and total of every set of disjoint nodes in the subtree of a node, the empty one first."""
    size, total = np.zeros(1, int), np.zeros(1)
    for child in range(4 * index, 4 * index + 4) if level + 1 < len(benefit) else ():
        below_size, below_total = every_set(benefit, level + 1, child)
        size = np.add.outer(size, below_size).reshape(-1)
        total = np.add.outer(total, below_total).reshape(-1)
    return np.append(size, 1), np.append(total, float(benefit[level][index]))


def best_totals(benefit):
    """Greatest total of a set of each size, by looking at every set of a forest."""
    size, total = np.zeros(1, int), np.zeros(1)
    for root in range(len(benefit[0])):
        more_size, more_total = every_set(benefit, 0, root)
        size = np.add.outer(size, more_size).reshape(-1)
        total = np.add.outer(total, more_total).reshape(-1)
    best = np.full(size.max() + 1, -np.inf)
    np.maximum.at(best, size, total)
    return best


def corners(best):
    """Sizes on the upper hull of the best totals, as long as it rises: those that some price picks."""
    found = [0]
    while found[-1] < len(best) - 1:
        here = found[-1]
        slope = (best[here + 1 :] - best[here]) / np.arange(1, len(best) - here)
        if slope.max() <= 0.0:
            break
        found.append(here + 1 + int(slope.argmax()))
    return found


def taken_total(benefit, taken):
    return sum(float(level[index].sum()) for level, index in zip(benefit, taken, strict=True))


def size_of(taken):
    return sum(index.numel() for index in taken)


def painted(taken):
    """How many of the nodes cover each cell of the finest level."""
    count = torch.zeros(4 ** (len(taken) + 1), dtype=torch.int64)
    for level, index in enumerate(taken):
        width = 4 ** (len(taken) - 1 - level)
        for first in (index * width).tolist():
            count[first : first + width] += 1
    return count


def random_benefit(seed, roots, levels, mean):
    """Normal numbers; coarse nodes about as good as all their children together, so that no level always wins."""
    generator = torch.Generator().manual_seed(seed)
    return [
        (torch.randn(roots * 4**level, generator=generator, dtype=torch.float64) + mean) * 3.0**-level
        for level in range(levels)
    ]


SHAPES = st.sampled_from([(1, 3), (4, 2), (2, 2), (4, 1)])


@given(st.integers(0, 10_000), SHAPES, st.integers(0, 20), st.floats(-1.0, 1.5))
def test_no_other_set_of_its_size_is_better(seed, shape, count, mean):
    roots, levels = shape
    benefit = random_benefit(seed, roots, levels, mean)
    taken, best = oracle.choose(benefit, count), best_totals(benefit)
    size = size_of(taken)
    assert len(taken) == len(benefit) and size <= count
    assert int(painted(taken).max()) <= 1
    assert taken_total(benefit, taken) == pytest.approx(best[size], abs=1e-9)
    assert size == max(corner for corner in corners(best) if corner <= count), "as large as a price can make it"
    if count >= len(best) - 1:
        assert taken_total(benefit, taken) == pytest.approx(best.max(), abs=1e-9), "all positive gain is taken"


def test_the_search_over_all_sets_is_one():
    """Two roots with four children each: (1 + 2^4)^2 sets, the best of a size by hand."""
    benefit = [torch.tensor([5.0, 1.0]), torch.tensor([1.0, 2.0, 3.0, -1.0, 0.5, 4.0, 0.0, 0.0])]
    assert len(every_set(benefit, 0, 0)[0]) == 17
    assert best_totals(benefit)[:6].tolist() == [0.0, 5.0, 9.0, 9.5, 10.0, 10.5]
    assert [index.tolist() for index in oracle.choose(benefit, 2)] == [[0], [5]]
    assert [index.tolist() for index in oracle.choose(benefit, 100)] == [[], [0, 1, 2, 4, 5]]


@pytest.mark.parametrize("count", [1, 3, 100])
def test_what_would_only_do_harm_is_left_out(count):
    benefit = [-random.abs() - 1e-6 for random in random_benefit(3, 1, 3, 0.0)]
    assert size_of(oracle.choose(benefit, count)) == 0
    assert size_of(oracle.choose([torch.zeros_like(level) for level in benefit], count)) == 0


@pytest.mark.parametrize("count", [1, 5, 11, 16])
def test_among_tiles_of_one_size_the_best_are_taken(count):
    gain = torch.randperm(16, generator=torch.Generator().manual_seed(1)).to(torch.float64) + 1.0
    coarse, whole = torch.full((4,), -1.0, dtype=torch.float64), torch.full((1,), -1.0, dtype=torch.float64)
    taken = oracle.choose([whole, coarse, gain], count)
    assert taken[0].numel() == taken[1].numel() == 0
    assert taken[2].tolist() == (gain > 16 - count).nonzero().squeeze(1).tolist()


# --- the run ---------------------------------------------------------------------------------------------------------


def truth_of(picture, side=CONFIG.resolution_px, per_axis=2):
    """The picture itself, box-filtered to pixels."""
    centre = (torch.arange(side * per_axis) + 0.5) / (side * per_axis)
    x, y = centre.expand(side * per_axis, -1), centre[:, None].expand(-1, side * per_axis)

    def truth(time_s):
        image = picture(x, y, torch.tensor(time_s, dtype=torch.float32)).to(torch.float32)
        return image.reshape(side, per_axis, side, per_axis, 3).mean((1, 3))

    return truth


def play(picture=EDGE, cycles=10, config=CONFIG, clock=None, truth=None, trace=None):
    trace, truth = trace or pictures.tracer(picture), truth or truth_of(picture, config.resolution_px)
    return list(runs.images("oracle", config, trace, clock or fixed_clock(CYCLE), 0.0, cycles * CYCLE, truth=truth))


def newest_of(shown):
    assert shown.sample_map is not None
    return shown.sample_map.newest_s


def play_uniform(picture, cycles):
    """The same number of framelets, one for every tile of the coarsest level: each is new in every cycle."""
    cache, tiling, side = FrameletCache(CONFIG), uniform(CONFIG.level_min), CONFIG.framelet_side
    for cycle in range(-WARMUP, cycles):
        batch = make_batch(tiling, torch.arange(tiling.tile_count), cycle * CYCLE, cycle, CONFIG)
        assert tiling.tile_count == CONFIG.batch_size
        color = pictures.tracer(picture)(batch).color
        cache.insert(batch, color, torch.zeros(tiling.tile_count, state_size(side**2, CONFIG.error)))
        shown = reconstruct(cache, CONFIG, CYCLE)
        display_s = (cycle + Oracle.latency_cycles) * CYCLE
        yield ShownImage(display_s, cycle * CYCLE, shown.image, shown.sample_map)


def error(displays, picture):
    """Mean squared error from the start on, of what is shown against what should be, as a display shows it."""
    truth, measured = truth_of(picture), [shown for shown in displays if shown.sample_time_s > -1e-9]
    pairs = [(shown.image.clamp(0, 1).pow(1 / 2.2), truth(shown.display_time_s).pow(1 / 2.2)) for shown in measured]
    return sum(float((shown - wanted).square().mean()) for shown, wanted in pairs) / len(pairs)


@pytest.mark.parametrize("picture", [EDGE, pictures.textured_motion], ids=["edge", "texture"])
def test_seeing_the_answer_beats_uniform_and_estimated_allocation(picture):
    found = error(play(picture), picture)
    estimated = list(runs.images("thesis", CONFIG, pictures.tracer(picture), fixed_clock(CYCLE), 0.0, 0.2))
    assert 0.0 < found <= error(play_uniform(picture, 10), picture)
    assert found <= error(estimated, picture)


def test_batches_are_disjoint_new_and_no_larger_than_paid_for(monkeypatch):
    """Whatever goes into the cache is what a renderer would have been asked for."""
    batches, picture = {}, pictures.textured_motion

    class Spy(FrameletCache):
        def insert(self, batch, color, coefficients):
            batches.setdefault(batch.cycle, []).append(batch)
            assert torch.equal(color, pictures.tracer(picture)(batch).color)
            return super().insert(batch, color, coefficients)

    monkeypatch.setattr(oracle, "FrameletCache", Spy)
    displays, levels = play(picture, 6), range(CONFIG.level_min, CONFIG.level_max + 1)
    assert list(batches) == list(range(-WARMUP, 6))
    for cycle, shown in zip(batches, displays, strict=True):
        taken = [
            torch.cat([b.index[b.level == level] for b in batches[cycle]]) for level in range(CONFIG.level_max + 1)
        ]
        assert 0 < sum(taken[level].numel() for level in levels) == size_of(taken) <= CONFIG.batch_size
        assert int(painted(taken).max()) == 1
        now_s = shown.sample_time_s
        assert all(b.time_s == now_s for b in batches[cycle])
        share = sum(taken[level].numel() * 0.25**level for level in levels)
        assert float((newest_of(shown) == now_s).double().mean()) == share


def test_a_cycle_costs_what_its_batch_does_and_is_judged_when_it_is_shown():
    """A clock that counts sees the rays of a batch, not those of the looking around."""
    bills, asked, truth = [], [], truth_of(EDGE)

    def clock(counters, wall_s):
        bills.append((dict(counters), wall_s))
        return 0.03

    def seen(time_s):
        asked.append(time_s)
        return truth(time_s)

    displays = play(clock=clock, truth=seen, cycles=4)
    assert len(bills) == len(displays) + 1, "one to learn how long a cycle is"
    assert all(0 < counters["primary_rays"] <= CONFIG.budget and wall_s > 0.0 for counters, wall_s in bills)
    assert asked == pytest.approx([shown.display_time_s for shown in displays])
    assert all(after.sample_time_s - now.sample_time_s == pytest.approx(0.03) for now, after in pairwise(displays))
    latency = [shown.display_time_s - shown.sample_time_s for shown in displays]
    assert latency == pytest.approx([Oracle.latency_cycles * 0.03] * len(displays))
    assert displays[0].sample_time_s == pytest.approx(-WARMUP * 0.03)
    with pytest.raises(ValueError, match="finite, positive cycle time"):
        play(clock=fixed_clock(0.0))


def test_runs_repeat_on_any_number_of_threads():
    config = TsarConfig(batch_size=32, resolution_px=128, warmup_cycles=1)
    runs = []
    table = [truth_of(pictures.textured_motion, 128, 1)(cycle * CYCLE) for cycle in range(8)]
    for threads in (1, 1, 2, 3):
        torch.set_num_threads(threads)
        runs.append(play(pictures.textured_motion, 1, config, truth=lambda time_s: table[round(time_s / CYCLE) % 8]))
    for other in runs[1:]:
        for shown, expected in zip(other, runs[0], strict=True):
            assert torch.equal(shown.image, expected.image)
            assert torch.equal(newest_of(shown), newest_of(expected))


def test_a_still_picture_is_learnt_once_and_then_left_alone():
    """All detail there is on the finest level: the error falls to nothing, and after that only rounding is chased."""
    displays = play(pictures.static_stripes, 12, replace(CONFIG, warmup_cycles=0))
    first, last = (error([displays[place]], pictures.static_stripes) for place in (0, -1))
    assert last < 1e-9 and first > 1e-4
    assert float(newest_of(displays[-1]).median()) < displays[-1].sample_time_s - 5 * CYCLE


def test_samples_that_are_not_finite_are_never_shown():
    def trace(batch):
        color = pictures.tracer(pictures.textured_motion)(batch).color
        color[:, ::17] = float("nan")
        return SampleBatch(color, {})

    displays = play(pictures.textured_motion, 2, trace=trace)
    assert all(bool(torch.isfinite(shown.image).all()) for shown in displays)
    assert error(displays, pictures.textured_motion) < 0.05
