"""How cost grows: exponents of known growth, and memory watched in another process."""

import math
from dataclasses import replace

import pytest

from analysis.bench.cycles import RunningPipeline, steady, synthetic_trace
from analysis.bench.growth import EXPONENT_LIMIT, TILE_BOUNDS, exponent, exponent_row, memory_rows, tiling_row, watched
from analysis.bench.options import BenchOptions
from analysis.command.progress import Task
from tsar.config import TsarConfig
from tsar.stages import Stages

SIZES = (16, 32, 64, 128)


@pytest.mark.parametrize("power", [-0.5, 0.0, 1.0, 2.0])
def test_the_exponent_of_a_power_is_found(power: float) -> None:
    assert exponent(SIZES, [3.0 * size**power for size in SIZES]) == pytest.approx(power)


def test_growth_within_and_beyond_the_limit() -> None:
    linear = exponent_row("linear", SIZES, [[1e-3 * size] * 3 for size in SIZES])
    assert linear.ours == pytest.approx(1.0) and linear.met is True and linear.peer == EXPONENT_LIMIT
    square = exponent_row("square", SIZES, [[1e-3 * size**2] * 3 for size in SIZES])
    assert square.ours == pytest.approx(2.0) and square.met is False
    # twice the size costs 4 times as much, where 2^1.05 is allowed
    assert square.ratio == pytest.approx(2**1.05 / 4)
    assert square.note.startswith("16: 256 ms, 32: ")


def test_an_order_is_divided_by_before_the_fit() -> None:
    seconds = [[1e-6 * size * math.log(size)] * 3 for size in SIZES]
    assert exponent_row("n log n", SIZES, seconds, math.log).ours == pytest.approx(1.0)


def test_turns_go_on_past_the_warm_up() -> None:
    config = steady(TsarConfig(batch_size=16, resolution_px=64, sdf_side=16, cache_size=64, warmup_cycles=0))
    assert config.warmup_cycles == -(-config.cache_slots // 16)
    turns = RunningPipeline(config, synthetic_trace, cycles_per_turn=3)
    for _ in range(4):
        turns()
    assert [len(turn) for turn in turns.turns()] == [3, 3, 3]
    assert all("reconstruction" in taken for turn in turns.turns() for taken in turn)


def test_tilings_reach_every_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    from analysis.bench import cycles as bench_cycles

    built, made = set(), bench_cycles.default_stages

    def counting(config: TsarConfig) -> Stages:
        stages = made(config)

        def decide(*arguments):
            decision = stages.decide(*arguments)
            built.add((config.tile_count_max, decision.tiling.tile_count))
            return decision

        return replace(stages, decide=decide)

    monkeypatch.setattr(bench_cycles, "default_stages", counting)
    row = tiling_row(BenchOptions(), Task())
    assert sorted(bound for bound, _ in built) == sorted(TILE_BOUNDS)
    assert all(bound - 3 <= tiles <= bound for bound, tiles in built)
    assert row.repetitions == BenchOptions().repetitions


def test_memory_is_watched_in_a_process_of_its_own() -> None:
    shown = []
    before, resident = watched(
        TsarConfig(batch_size=16, resolution_px=64, sdf_side=16, warmup_cycles=2), 100, Task(show=shown.append)
    )
    assert len(resident) == 5 and shown == [0, 20, 40, 60, 80, 100]
    assert min(resident) > before > 10e6


def test_memory_that_grows_misses_its_target(monkeypatch: pytest.MonkeyPatch) -> None:
    from analysis.bench import growth as bench_growth

    def rows(last: int):
        grown = [200_000_000] * 19 + [last]
        monkeypatch.setattr(bench_growth, "watched", lambda *_: (100_000_000, grown))
        return list(memory_rows(BenchOptions(cycles=400), Task()))

    flat, per_megapixel = rows(201_000_000)
    assert flat.met is True and flat.ours == pytest.approx(1.005)
    assert per_megapixel.ours == pytest.approx(101.0 / 0.512**2) and per_megapixel.met is None
    assert rows(250_000_000)[0].met is False
