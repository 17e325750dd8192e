"""Every policy with cycles far shorter or longer than any machine's, and far from time zero."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from tests.oracles.screens import Layer, Screen
from tests.tsar.policies.every import CASES, made, share_of_a_batch
from tests.tsar.policies.test_behaviour import disk, grey, stripes
from tsar.clock import fixed_clock
from tsar.config import StagesName
from tsar.policy import Moment, run, step

SHORT_S = 2.0**-20
"""A microsecond, of which float64 holds multiples exactly up to 4e9 s."""
FAR_S = 2.0**20
CYCLES = 16


def moving(start_s: float, speed: float) -> Screen:
    """A disk that crosses the picture."""

    def pose(t: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        return torch.zeros_like(t), (speed * (t - start_s)).clamp(-1.0, 1.0), torch.zeros_like(t)

    return Screen((Layer(grey(0.9), disk, pose), Layer(stripes)))


@pytest.mark.parametrize(("policy", "kind"), CASES)
def test_cycles_of_a_microsecond_are_the_same_a_million_seconds_later(policy: str, kind: StagesName) -> None:
    """Pictures to the bit; times of samples as far as float64 tells them; no age stands still."""
    pictures, newest = [], []
    for start_s in (0.0, FAR_S):
        screen = moving(start_s, 0.5 / (CYCLES * SHORT_S))
        found = made(policy, kind, screen)
        cycle_s, state = SHORT_S * min(share_of_a_batch(found), 1.0), found.start()
        for cycle in range(CYCLES):
            done = step(found, state, screen.trace, Moment(start_s + cycle * cycle_s, cycle, cycle_s))
            state = done.after
            pictures.append(done.shown.image)
            sampled = done.shown.sample_map
            newest.append(-math.inf if sampled is None else float(sampled.newest_s.max()) - start_s)
    near, far = pictures[:CYCLES], pictures[CYCLES:]
    assert all(torch.equal(one, other) for one, other in zip(near, far, strict=True))
    for one, other in zip(newest[:CYCLES], newest[CYCLES:], strict=True):
        assert one == other or abs(one - other) <= 0.5 * math.ulp(FAR_S)
    assert max(newest) > 0.2 * CYCLES * SHORT_S * min(share_of_a_batch(found), 1.0)
    assert not torch.equal(near[0], near[-1])


@pytest.mark.parametrize("cycle_s", [1e-30, 1e20])
@pytest.mark.parametrize(("policy", "kind"), CASES)
def test_cycles_of_any_length_give_pictures(policy: str, kind: StagesName, cycle_s: float) -> None:
    """As on machines of 1e-9 and 1e30 operations a second, which commands refuse."""
    screen = moving(0.0, 0.0)
    found, cycles = made(policy, kind, screen), 8
    state = found.start()
    for cycle in range(cycles):
        done = step(found, state, screen.trace, Moment(cycle * cycle_s, cycle, cycle_s))
        state = done.after
        assert bool(done.shown.image.isfinite().all())
    assert 0.0 <= float(done.shown.image.min()) and float(done.shown.image.max()) <= 0.9 + 1e-4
    sampled = done.shown.sample_map
    if sampled is not None:
        assert float(sampled.newest_s.max()) <= cycles * cycle_s


@pytest.mark.parametrize("start_s", [1e6, 1e9, -1e9])
def test_a_clock_that_time_does_not_feel_is_refused(start_s: float) -> None:
    """Refused, not played forever: at 1e9 s the times of float64 are 1.2e-7 s apart."""
    screen = moving(0.0, 0.0)
    found = made("frameless", "reference", screen)
    with pytest.raises(ValueError, match=r"clock: expected cycles that move .* got 1e-12 s"):
        for _ in run(found, screen.trace, fixed_clock(1e-12), start_s, start_s + 1.0):
            pass
