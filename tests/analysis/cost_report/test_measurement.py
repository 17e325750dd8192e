"""Refitting to synthetic seconds, and a measurement of a small pipeline."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import torch

from analysis.command.progress import Task
from analysis.cost_report.measurement import measure, prepare
from analysis.cost_report.options import MeasurementOptions
from analysis.cost_report.refit import (
    Cell,
    MemoryTrace,
    advantages,
    affine_line,
    exponents,
    memory_growth,
    origin_line,
    power_law,
    refit,
)
from analysis.metrics.cost_model import CostParameters, stage_flops

SETTINGS = MeasurementOptions()
STAGES = tuple(stage_flops(CostParameters()))
PRICE = {name: 1e-11 * (number + 1) for number, name in enumerate(("tracing", "cache", *STAGES))}
MIB = 2.0**20


def cell(setting: tuple[int, int], seconds: Callable[[str, float], float], image_s: float = 0.5) -> Cell:
    """A setting whose stages take seconds given by a function of their name and operations."""
    batch, side = setting
    p = CostParameters(batch_size=batch, recon_res=side**2, trace_segments=2.5, tiling_size=4 * batch)
    empty = Cell(batch, side, {}, 0.0, 2.5, p, image_s, image_s, 2.5, 1, 1)
    stage_s = {name: seconds(name, flops) for name, flops in empty.flops.items()}
    return dataclasses.replace(empty, stage_s=stage_s, cycle_s=sum(stage_s.values()))


# --- lines and power laws --------------------------------------------------------------------------------------------


def test_lines_by_hand() -> None:
    line = origin_line([1.0, 2.0], [1.0, 3.0])
    assert line.per_unit == pytest.approx(7 / 5) and line.offset == 0.0
    assert line.r2 == pytest.approx(1 - (0.4**2 + 0.2**2) / 2) and line.worst == pytest.approx(0.4)
    sloped = affine_line([0.0, 1.0, 2.0], [1.0, 2.0, 6.0])
    assert sloped is not None and (sloped.per_unit, sloped.offset) == pytest.approx((2.5, 0.5))
    assert sloped(4.0) == pytest.approx(10.5)
    assert affine_line([3.0, 3.0], [1.0, 2.0]) is None
    assert origin_line([1.0, 1.0], [2.0, 2.0]).r2 is None


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.7])
def test_exponents_of_power_laws(exponent: float) -> None:
    x = [32.0, 64.0, 128.0, 256.0, 512.0]
    law = power_law(x, [3e-4 * value**exponent for value in x])
    assert law.exponent == pytest.approx(exponent) and law.factor == pytest.approx(3e-4)
    assert law.spread == pytest.approx(0.0, abs=1e-9) and (law.low, law.high) == (32.0, 512.0)
    assert law.above_fixed == pytest.approx(exponent, abs=1e-3)


@pytest.mark.parametrize("exponent", [1.0, 1.4])
def test_a_fixed_cost_lowers_the_exponent_but_not_the_one_above_it(exponent: float) -> None:
    x = [32.0, 64.0, 128.0, 256.0, 512.0]
    law = power_law(x, [0.02 + 1e-4 * value**exponent for value in x])
    assert law.exponent < 0.8 * exponent and law.spread > 0.02
    assert law.above_fixed == pytest.approx(exponent, abs=1e-2)
    if exponent == 1.0:
        assert law.linear.offset == pytest.approx(0.02) and law.linear.r2 == pytest.approx(1.0)


def test_spread_is_that_of_the_values_about_the_line() -> None:
    rng = np.random.default_rng(3)
    x = np.geomspace(1.0, 1000.0, 4000)
    law = power_law(x.tolist(), (x * np.exp(0.1 * rng.standard_normal(x.size))).tolist())
    assert math.log1p(law.spread) == pytest.approx(0.1, rel=0.05)


def test_power_laws_want_positive_values() -> None:
    with pytest.raises(ValueError, match="power_law.*positive"):
        power_law([1.0, 2.0], [0.0, 1.0])
    with pytest.raises(ValueError, match="power_law.*different"):
        power_law([2.0, 2.0], [1.0, 1.0])


# --- refit -----------------------------------------------------------------------------------------------------------


def test_refit_recovers_prices() -> None:
    cells = [cell(setting, lambda name, flops: PRICE[name] * flops) for setting in SETTINGS.settings]
    fits = refit(cells)
    assert set(fits) == {*STAGES, "cache"}
    for name, fit in fits.items():
        assert fit.origin.per_unit == pytest.approx(PRICE[name]), name
        assert fit.relative_to_tracing == pytest.approx(PRICE[name] / PRICE["tracing"])
        assert fit.origin.worst < 1e-9
    assert fits["response"].affine is None, "the model says the same for every setting"
    assert fits["tracing"].affine is not None and abs(fits["tracing"].affine.offset) < 1e-9


def test_refit_recovers_a_fixed_cost() -> None:
    fixed = {name: 1e-3 * (number + 1) for number, name in enumerate(PRICE)}
    cells = [cell(setting, lambda name, flops: fixed[name] + PRICE[name] * flops) for setting in SETTINGS.settings]
    for name, fit in refit(cells).items():
        if fit.affine is not None:
            assert fit.affine.offset == pytest.approx(fixed[name], rel=1e-6), name
            assert fit.affine.per_unit == pytest.approx(PRICE[name], rel=1e-6), name
            assert fit.best is fit.affine and fit.origin.worst > 0.01
    assert sum(fit.affine is not None for fit in refit(cells).values()) == 6


def test_refitted_advantage_is_the_measured_one_where_the_model_is_right() -> None:
    found = []
    for setting in SETTINGS.settings:
        shaped = cell(setting, lambda name, flops: PRICE[name] * flops)
        found.append(dataclasses.replace(shaped, image_s=PRICE["tracing"] * shaped.image_flops))
    rows = advantages(found, refit(found))
    assert [(row["batch_size"], row["resolution_px"]) for row in rows] == SETTINGS.settings
    for row in rows:
        assert row["refitted"] == pytest.approx(row["measured"]) == pytest.approx(row["refitted_origin"])
        assert row["modelled"] > row["measured"], "every stage is dearer here than tracing"


def test_exponents_are_taken_along_the_cross_of_settings() -> None:
    seconds = {"tracing": lambda b, s: 1e-4 * b, "reconstruction": lambda b, s: 1e-8 * s**2}
    cells = []
    for batch, side in SETTINGS.settings:
        stage_s = {name: rule(batch, side) for name, rule in seconds.items()}
        shaped = cell((batch, side), lambda name, flops: flops)
        cells.append(dataclasses.replace(shaped, stage_s=stage_s, cycle_s=sum(stage_s.values())))
    laws = exponents(cells, SETTINGS.centre)
    assert laws["tracing_by_batch"].exponent == pytest.approx(1.0)
    assert laws["reconstruction_by_pixels"].exponent == pytest.approx(1.0)
    assert laws["cycle_by_batch"].linear.per_unit == pytest.approx(1e-4)
    assert laws["cycle_by_batch"].linear.offset == pytest.approx(1e-8 * 512**2)
    assert (laws["cycle_by_pixels"].low, laws["cycle_by_pixels"].high) == (128**2, 1024**2)


# --- memory ----------------------------------------------------------------------------------------------------------


def test_memory_growth_of_a_leak_and_of_a_start() -> None:
    cycle = list(range(0, 1001, 10))
    leak = MemoryTrace(128, 1024, int(50 * MIB), cycle, [int(100 * MIB + 4096 * number) for number in cycle])
    found = memory_growth(leak)
    assert found["slope_bytes_per_1000_cycles"] == pytest.approx(4096e3)
    assert found["slope_settled_bytes_per_1000_cycles"] == pytest.approx(4096e3)
    assert found["rise_after_warmup_bytes"] == 4096e3
    assert found["pipeline_bytes_per_megapixel"] == pytest.approx((50 * MIB + 4096e3) / 1.048576)
    step = MemoryTrace(128, 1024, 0, cycle, [int((100 + (number > 50)) * MIB) for number in cycle])
    settled = memory_growth(step)
    assert settled["slope_settled_bytes_per_1000_cycles"] == 0.0 < settled["slope_bytes_per_1000_cycles"]
    assert settled["rise_after_warmup_bytes"] == MIB


# --- the pipeline ----------------------------------------------------------------------------------------------------


class Silent:
    """Bars that record their calls."""

    def __init__(self) -> None:
        self.told: dict[str, list[int]] = {}

    def task(self, label: str, total: int) -> Task:
        return Task(show=self.told.setdefault(label, [total]).append)


def test_the_cache_is_full_before_a_setting_is_measured() -> None:
    for batch, side in SETTINGS.settings:
        config = SETTINGS.pipeline(batch, side)
        assert config.warmup_cycles * batch >= config.cache_slots and config.warmup_cycles >= 48
        assert (config.batch_size, config.resolution_px) == (batch, side)


@pytest.fixture
def one_torch_thread() -> Iterator[None]:
    """On a busy machine the threads of torch wait for one another; their number does not matter here."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def test_a_small_pipeline_is_measured(one_torch_thread: None) -> None:
    options = MeasurementOptions(
        measured_batches=(4, 8, 16),
        measured_resolutions=(64, 128, 256),
        measured_batch=16,
        measured_resolution=64,
        repetitions=2,
        cycles_per_turn=2,
        measured_warmup=6,
        memory_cycles=8,
        memory_every=2,
        threads=2,
    )
    bars = Silent()
    measured = measure(options, prepare(options), bars)  # type: ignore[arg-type]
    assert bars.told == {"memory": [8, 0, 2, 4, 6, 8], "measurement": [3, 1, 2, 3]}
    assert (measured.device, measured.threads) == ("cpu", 2) and measured.torch_threads == 1
    assert [(c.batch_size, c.resolution_px) for c in measured.cells] == options.settings
    assert len(options.settings) == 5
    for found in measured.cells:
        assert (found.cycles, found.images) == (4, 2)
        assert set(found.stage_s) == {*STAGES, "cache"} == set(found.flops)
        assert min(found.stage_s.values()) > 0.0 and found.cycle_s < 2.0
        assert 1.0 <= found.segments < 8.0 and 1.0 <= found.image_segments < 8.0
        assert 0.0 < found.image_trace_s <= found.image_s
        assert (found.parameters.batch_size, found.parameters.recon_res) == (found.batch_size, found.resolution_px**2)
        assert found.parameters.trace_segments == found.segments
    assert measured.memory is not None and list(measured.memory.cycle) == [0, 2, 4, 6, 8]
    assert 0 < measured.memory.before_bytes and min(measured.memory.resident_bytes) > 2.0**26
    fits = refit(measured.cells)
    assert len(advantages(measured.cells, fits)) == 5
    centre = measured.centre(options)
    assert (centre.batch_size, centre.resolution_px) == (16, 64)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"measured_batches": (32, 32, 64)}, "measured_batches"),
        ({"measured_resolutions": (128, 256)}, "measured_resolutions"),
        ({"measured_resolutions": (128, 256, 300)}, "resolution_px"),
        ({"measured_batches": (0, 1, 2)}, "measured_batches"),
        ({"repetitions": 0}, "repetitions"),
        ({"cycle_s": math.nan}, "cycle_s"),
        ({"memory_cycles": 5}, "memory_cycles"),
        ({"threads": -1}, "threads"),
    ],
)
def test_bad_options_are_named(change: dict, name: str) -> None:
    with pytest.raises(ValueError, match=name):
        MeasurementOptions(**change)
