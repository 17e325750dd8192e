"""Compiled response, tiling and selection against the tensor operations that define them."""

from __future__ import annotations

import math
from itertools import cycle, product

import jaxtyping
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.stages.control import Control
from tests.oracles import runs
from tests.renderer.stages.alike import (
    assert_same_densities,
    assert_same_request,
    decided_by_reference,
    errors_of,
    same_tiling,
)
from tests.renderer.stages.builders import small
from tests.tsar.response import extremes
from tests.tsar.response.test_extremes import RESPONSES, assert_kept, configured
from tsar import response
from tsar.choices import SOLVERS
from tsar.clock import StageTimer
from tsar.config import ResponseConfig, TilingConfig, TsarConfig
from tsar.decision import Decision
from tsar.response import initial_densities, respond
from tsar.selection import initial_history
from tsar.stages import REFERENCE
from tsar.tiling import build
from tsar.types import Densities, Errors


def decided(densities: Densities, history: torch.Tensor, config: TsarConfig) -> Decision:
    """The same by the compiled stages: a batch without errors changes no density."""
    none = Errors(*torch.zeros(2, config.sdf_side**2).unbind(0))
    return Control(config).decide(densities, none, history, config, StageTimer())


@given(seed=st.integers(0, 10_000), steps=st.sampled_from([1, 3, 1000]))
def test_selection_among_equals_and_others(seed: int, steps: int) -> None:
    """Credits of few distinct values, so that many tiles are equally overdue."""
    config = small(batch_size=16)
    g = torch.Generator().manual_seed(seed)
    density = torch.rand(128**2, generator=g, dtype=torch.float64) ** 6 * 16
    history = torch.randint(-steps, steps + 1, (128**2,), generator=g).to(torch.float64) / steps
    densities = Densities(density, torch.full_like(history, 0.5))
    assert_same_request(decided(densities, history, config).due, decided_by_reference(densities, history, config).due)


@given(seed=st.integers(0, 10_000), power=st.sampled_from([0, 1, 8]), most=st.sampled_from([64, 100, 256]))
def test_tilings_of_equals_and_others(seed: int, power: int, most: int) -> None:
    config = small(tiling=TilingConfig(tile_count_max=most))
    g = torch.Generator().manual_seed(seed)
    coarse = torch.randint(0, 4, (4 ** (seed % 8),), generator=g).to(torch.float64) ** power
    density = coarse.repeat_interleave(128**2 // coarse.numel()) * 8
    even = torch.full_like(density, 0.5)
    assert same_tiling(decided(Densities(density, even), even, config).tiling, build(density, config))


@pytest.mark.parametrize("bad", [-1e-300, float("nan"), float("inf")])
def test_what_is_not_a_density_is_refused(bad: float) -> None:
    config = small()
    field = torch.ones(128**2, dtype=torch.float64)
    even = field.clone()
    field[777] = bad
    with pytest.raises(ValueError, match="finite, non-negative densities"):
        decided(Densities(field, even), even, config)


@pytest.mark.parametrize("bad", [-1e-300, float("nan"), float("inf")])
def test_what_is_not_a_temporal_density_is_refused(bad: float) -> None:
    config = small()
    even = torch.full((128**2,), 0.5, dtype=torch.float64)
    field = even.clone()
    field[777] = bad
    for decide in (decided, decided_by_reference):
        with pytest.raises(ValueError, match="finite, non-negative densities"):
            decide(Densities(even, field), even, config)


def test_a_batch_that_the_tiling_cannot_fill_is_refused() -> None:
    """Only chosen tiles are requested, even if such a configuration is let through."""
    config = small()
    object.__setattr__(config.tiling, "tile_count_max", 31)
    even = torch.ones(128**2, dtype=torch.float64)
    for decide in (decided, decided_by_reference):
        with pytest.raises(ValueError, match="at least 32 tiles, a full batch, got 31"):
            decide(Densities(even, even), even, config)


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    kind=st.sampled_from(["mixed", "all ask", "all free", "few ask much", "none"]),
    surplus_max=st.sampled_from([0.0, 0.1, 1.0]),
    bias=st.sampled_from([0.0, 0.5, -2.0]),
)
def test_decisions_agree(seed: int, kind: str, surplus_max: float, bias: float) -> None:
    """From states made by earlier decisions, some at the bounds, with much or no surplus."""
    config = small(sdf_side=32, resolution_px=128, response=ResponseConfig(surplus_max=surplus_max, bias=bias))
    control, g = Control(config), torch.Generator().manual_seed(seed)
    densities, history = initial_densities(config), initial_history(config)
    for turn in range(4):
        errors = errors_of(kind if turn else "mixed", g, 32**2)
        ours = control.decide(densities, errors, history, config, StageTimer()).densities
        densities = response.respond(densities, errors, config)
        assert_same_densities(ours, densities, config)
    if kind == "none":
        assert torch.equal(ours.spatial, densities.spatial) and ours.surplus == densities.surplus


@pytest.mark.parametrize("response", RESPONSES, ids=lambda r: f"{r.gain:g} {r.bias:g} {r.surplus_max:g}")
def test_decisions_agree_at_the_ends(response: ResponseConfig) -> None:
    """Densities at their least and greatest, errors one-sided, along an axis and a step from it."""
    config = configured("waterfill", response)
    control, history = Control(config), initial_history(config)
    starts = extremes.densities(config.sdf_side**2, *config.spatial_bounds, *config.temporal_bounds)
    surplus = cycle((0.0, response.surplus_max * config.budget))
    for (spatial, temporal), phi in product(starts.values(), extremes.errors(config.sdf_side**2).values()):
        before, errors = Densities(spatial, temporal, next(surplus)), Errors(phi[0], phi[1])
        found = control.decide(before, errors, history, config, StageTimer()).densities
        assert_kept(before, found, config)
        assert_same_densities(found, respond(before, errors, config), config)


@pytest.mark.parametrize("cycles", [5_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_decisions_do_not_drift(cycles: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The errors lean to one side and back again every few thousand cycles."""
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    config = TsarConfig(sdf_side=16, resolution_px=128, batch_size=16)
    control, g = Control(config), torch.Generator().manual_seed(11)
    densities, history = initial_densities(config), initial_history(config)
    (low_s, high_s), (low_t, high_t) = config.spatial_bounds, config.temporal_bounds
    worst = 0.0
    for turn in range(cycles):
        noise = torch.rand(3, 256, generator=g)
        field = torch.where(noise[2] < 0.4, (2 * noise[:2] - 1 + 0.3 * math.sin(turn / 500.0)).clamp(-1, 1), 0.0)
        decision = control.decide(densities, Errors(field[0], field[1]), history, config, StageTimer())
        densities, history = decision.densities, decision.due.history
        assert 0.0 <= densities.surplus <= config.response.surplus_max * config.budget * (1 + 1e-9)
        if turn % 1000 == 999:
            worst = max(worst, abs((float(densities.combined().sum()) + densities.surplus) / config.budget - 1.0))
            assert low_s * (1 - 1e-12) <= densities.spatial.min() and densities.spatial.max() <= high_s * (1 + 1e-12)
            assert low_t * (1 - 1e-12) <= densities.temporal.min() and densities.temporal.max() <= high_t * (1 + 1e-12)
            assert float(history.abs().max()) < 1e3
    print(f"conservation is off by {worst:.2g} at most")
    # a step of 2^-52 of the budget a cycle, all to one side
    assert worst <= cycles * 2.0**-52


@pytest.mark.parametrize("solver", SOLVERS)
def test_other_solvers_are_left_to_the_reference(solver: str) -> None:
    config = small(response=ResponseConfig(solver=solver))
    state, g = runs.made("thesis", config).start(), torch.Generator().manual_seed(5)
    errors, history = errors_of("mixed", g, config.sdf_side**2), state.due.history
    found = Control(config).decide(state.densities, errors, history, config, StageTimer())
    wanted = REFERENCE.decide(state.densities, errors, history, config, StageTimer())
    assert_same_densities(found.densities, wanted.densities, config)
    assert same_tiling(found.tiling, wanted.tiling) or solver == "waterfill"
    assert torch.equal(found.densities.spatial, wanted.densities.spatial) or solver == "waterfill"
