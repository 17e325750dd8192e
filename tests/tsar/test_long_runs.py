"""Long runs: how far single and double precision come apart, and that nothing drifts."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice

import pytest
import torch
from torch import Tensor

from tests.oracles.screens import Layer, Screen
from tests.tsar.policies.every import made, share_of_a_batch
from tests.tsar.policies.test_behaviour import CYCLE_S, SIDE, disk, grey, stripes
from tsar.clock import StageTimer, fixed_clock
from tsar.config import TsarConfig
from tsar.policy import Moment, Picture, Policy, Setting, run, step
from tsar.roots import encoded
from tsar.types import FrameletBatch, SampleBatch


@contextmanager
def in_double() -> Iterator[None]:
    """The reference in float64 throughout, where it says float32 too; tables are made anew, before and after."""
    single = torch.float32
    torch.float32 = torch.float64  # type: ignore[misc]
    torch.set_default_dtype(torch.float64)
    _forget_tables()
    try:
        yield
    finally:
        torch.set_default_dtype(single)
        torch.float32 = single  # type: ignore[misc]
        _forget_tables()


def _forget_tables() -> None:
    for name, module in list(sys.modules.items()):
        if name.startswith("tsar."):
            for entry in list(vars(module).values()):
                if hasattr(entry, "cache_clear"):
                    entry.cache_clear()


SCREEN = Screen(
    (Layer(stripes, disk, lambda t: (3.0 * t, 0.2 * torch.sin(t), 0.1 * torch.cos(2.0 * t))), Layer(grey(0.3)))
)
"""A disk of stripes that turns and wanders."""


def played(policy: str, cycles: int) -> tuple[list[Tensor], list[Tensor], list[float]]:
    """Places of the samples, pictures, and their mean squared errors at the time that they show, cycle by cycle."""
    found = made(policy, "reference", SCREEN)
    state, cycle_s = found.start(), CYCLE_S * share_of_a_batch(found)
    places, pictures, errors = [], [], []

    def trace(batch: FrameletBatch) -> SampleBatch:
        places.append(batch.position.to(torch.float64))
        return SCREEN.trace(batch)

    for cycle in range(cycles):
        done = step(found, state, trace, Moment(cycle * cycle_s, cycle, cycle_s))
        state, image = done.after, done.shown.image.to(torch.float64)
        pictures.append(image)
        if cycle % 50 == 49:
            truth = SCREEN.picture(cycle * cycle_s, SIDE, 2).to(torch.float64)
            errors.append(float((encoded(image) - encoded(truth)).square().mean()))
    return places, pictures, errors


@dataclass(frozen=True)
class Apart:
    """How far two runs are apart: cycle of the first other decision, greatest difference of pictures before it and
    mean difference after, and the mean errors of both."""

    first: int
    before: float
    after: float
    errors: tuple[float, float]


def apart(policy: str, cycles: int) -> Apart:
    single = played(policy, cycles)
    with in_double():
        double = played(policy, cycles)
    first = next((n for n in range(cycles) if not torch.equal(single[0][n], double[0][n])), cycles)
    off = [(one - other).abs() for one, other in zip(single[1], double[1], strict=True)]
    before = max((float(one.max()) for one in off[:first]), default=0.0)
    after = sum(float(one.mean()) for one in off[first:]) / max(cycles - first, 1)
    return Apart(first, before, after, (sum(single[2]) / len(single[2]), sum(double[2]) / len(double[2])))


@pytest.mark.parametrize(
    ("policy", "cycles"),
    [
        ("filter", 60),
        ("thesis", 60),
        pytest.param("filter", 2000, marks=pytest.mark.slow),
        pytest.param("thesis", 2000, marks=pytest.mark.slow),
    ],
)
def test_single_precision_decides_as_double_does_or_as_well(policy: str, cycles: int) -> None:
    """Until a decision differs pictures are apart by rounding alone; from there on errors are as large."""
    found = apart(policy, cycles)
    print(policy, cycles, found)
    assert found.first >= 8 and found.before < 1e-4
    assert abs(found.errors[0] / found.errors[1] - 1.0) < 0.05


class Idle(Policy[int]):
    """Does nothing."""

    @property
    def warmup_cycles(self) -> int:
        return 0

    def start(self) -> int:
        return 0

    def request(self, state: int, moment: Moment) -> tuple[int, FrameletBatch]:
        return state, BATCH

    def observe(self, state: int, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer) -> int:
        return state + 1

    def image(self, state: int, moment: Moment) -> Picture:
        return Picture(IMAGE)


BATCH = FrameletBatch(torch.zeros(1, dtype=torch.int64), torch.zeros(1, dtype=torch.int64), torch.zeros(1, 1, 2), 0.0)
IMAGE = torch.zeros(1, 1, 3)


@pytest.mark.parametrize("cycles", [3_000, pytest.param(100_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("start_s", [0.0, 1e6])
def test_the_clock_of_many_cycles(start_s: float, cycles: int) -> None:
    """Times are sums: each addition rounds by half a step of float64 at most, and no more."""
    cycle_s = 1.0 / 60.0
    policy, answer = Idle(Setting(TsarConfig())), SampleBatch(torch.zeros(1, 1, 3), {})
    pictures = run(policy, lambda batch: answer, fixed_clock(cycle_s), start_s, 1e9)
    _, shown = next(islice(pictures, cycles, None))
    exact = start_s + cycles * cycle_s
    assert abs(shown.sample_time_s - exact) <= cycles * 0.5 * math.ulp(exact)


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["tsar", "thesis"])
def test_a_hundred_thousand_cycles_show_what_ten_thousand_do(policy: str) -> None:
    """Of a still scene: no picture fades, no age stands still, and no decision wears out."""
    screen = Screen((Layer(stripes),))
    found = made(policy, "compiled", screen)
    state, cycle_s, truth = found.start(), 2.0**-9, encoded(screen.picture(0.0, SIDE))
    errors = []
    for cycle in range(100_000):
        done = step(found, state, screen.trace, Moment(cycle * cycle_s, cycle, cycle_s))
        state = done.after
        if cycle % 10_000 == 9_999:
            assert bool(done.shown.image.isfinite().all()) and done.shown.sample_map is not None
            newest_s = done.shown.sample_map.newest_s
            assert float(newest_s.max()) >= cycle * cycle_s and float(newest_s.min()) > (cycle - 5_000) * cycle_s
            errors.append(float((encoded(done.shown.image) - truth).square().mean()))
    print(policy, errors)
    assert max(errors[1:]) <= 1.05 * errors[0] + 1e-6
