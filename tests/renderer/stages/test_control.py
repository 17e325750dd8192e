"""A whole cycle of the compiled control stages against the tensor operations that define it."""

from __future__ import annotations

import copy

import jaxtyping
import pytest
import torch

from renderer.stages.control import compiled_stages, stages
from tests.oracles import pictures, runs
from tests.renderer.stages.alike import (
    assert_same_cache,
    assert_same_densities,
    assert_same_request,
    decided_by_reference,
    same_tiling,
)
from tests.renderer.stages.builders import CONFIGS, CYCLE_S, moments, small
from tests.renderer.stages.twins import tolerance
from tsar.clock import StageTimer, fixed_clock
from tsar.stages import REFERENCE
from tsar.types import Densities, Errors


@pytest.mark.parametrize("name", CONFIGS)
def test_every_stage_agrees_with_the_reference_on_the_way(name: str) -> None:
    """Equal inputs: equal choices, tilings and cache; errors and densities within rounding."""
    config = CONFIGS[name]
    ours = compiled_stages(config)
    past, moving = 0, 0.0
    for moment in moments(config, 40, 2):
        state, outcome = moment.before, moment.outcome
        cache = state.cache
        batch = state.due.at(moment.number * CYCLE_S, moment.number, config)
        past += int(cache.previous(batch.level, batch.index)[1].sum())
        theirs = copy.deepcopy(cache)
        found = ours.observe(batch, outcome.samples.color, cache, config, StageTimer())
        wanted = REFERENCE.observe(batch, outcome.samples.color, theirs, config, StageTimer())
        for axis in ("spatial", "temporal"):
            pair = getattr(found.errors, axis), getattr(wanted.errors, axis)
            torch.testing.assert_close(*pair, rtol=0.0, atol=tolerance(config, axis))
        assert found.nonfinite == 0
        assert_same_cache(cache, theirs)
        spent = StageTimer()
        after = ours.decide(state.densities, moment.after.errors, state.due.history, config, spent)
        assert set(spent.seconds) == {"response", "tiling", "selection"} and min(spent.seconds.values()) > 0.0
        assert_same_densities(after.densities, moment.after.densities, config)
        follows = decided_by_reference(after.densities, state.due.history, config)
        assert same_tiling(after.tiling, follows.tiling)
        assert_same_request(after.due, follows.due)
        newest = outcome.shown.sample_map.newest_s
        account, expected = (
            s.account(moment.after.densities, moment.after.errors, newest, config) for s in (ours, REFERENCE)
        )
        assert account.combined == pytest.approx(expected.combined, rel=1e-12)
        assert account.age_spread_s == expected.age_spread_s and account.nonfinite == expected.nonfinite == 0
        moving = max(moving, account.age_spread_s)
    assert past > 0, "no tile came back: temporal errors were not looked at"
    assert moving > 0.0 or name not in ("default", "small"), "ages were alike everywhere"


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_fields_that_are_not_finite_are_counted(value: float) -> None:
    config = small()
    state, none = runs.made("thesis", config).start(), torch.zeros(128**2)
    newest = torch.zeros(2**config.level_max, 2**config.level_max, dtype=torch.float64)
    for number in range(4):
        spatial, temporal = state.densities.spatial.clone(), state.densities.temporal.clone()
        fields = spatial, temporal, none.clone(), none.clone()
        fields[number][[3, 16383]] = value
        for found in (compiled_stages(config), REFERENCE):
            account = found.account(Densities(*fields[:2]), Errors(*fields[2:]), newest, config)
            assert account.nonfinite == 2


def test_invariants_hold_over_a_thousand_cycles(monkeypatch: pytest.MonkeyPatch) -> None:
    # shapes are checked by the other tests; here the checks would take longer than the cycles
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    config = small(resolution_px=64, batch_size=16, sdf_side=32, framelet_side=16)
    low, high = config.spatial_bounds
    cycles = runs.play(
        "thesis",
        config,
        pictures.tracer(pictures.textured_motion),
        fixed_clock(1e-3),
        0.0,
        1.0,
        compiled_stages(config),
    )
    count = 0
    for record, display in cycles:
        count += 1
        d = record.densities
        assert record.conservation_residual <= 1e-9 and record.nonfinite == 0
        assert low * (1 - 1e-12) <= float(d.spatial.min()) and float(d.spatial.max()) <= high * (1 + 1e-12)
        assert config.response.temporal_min * (1 - 1e-12) <= float(d.temporal.min()) and float(d.temporal.max()) <= 1.0
        assert float((0.25 ** record.tiling.level.to(torch.float64)).sum()) == 1.0
        assert record.selected.unique().numel() == config.batch_size
        assert bool(torch.isfinite(display.image).all())
    assert count >= 1000


def test_runs_give_the_same_bits_on_any_number_of_threads() -> None:
    config = small(warmup_cycles=8)

    def played(threads: int):
        trace = pictures.tracer(pictures.textured_motion)
        return list(
            runs.play("thesis", config, trace, fixed_clock(CYCLE_S), 0.0, 6 * CYCLE_S, compiled_stages(config, threads))
        )

    first = played(1)
    for other in (played(2), played(3), played(1)):
        for (record, display), (expected, shown) in zip(other, first, strict=True):
            assert torch.equal(display.image, shown.image) and torch.equal(record.selected, expected.selected)
            assert torch.equal(record.errors.spatial, expected.errors.spatial)
            assert torch.equal(record.errors.temporal, expected.errors.temporal)
            assert torch.equal(record.densities.spatial, expected.densities.spatial)
            assert torch.equal(record.densities.temporal, expected.densities.temporal)
            assert same_tiling(record.tiling, expected.tiling) and record.surplus == expected.surplus


def test_the_stages_are_chosen_by_name() -> None:
    assert stages(small(), "reference") == REFERENCE
    assert stages(small()).decide != REFERENCE.decide


def test_stages_refuse_another_configuration_than_theirs() -> None:
    ours, state = compiled_stages(small()), runs.made("thesis", small()).start()
    other, none = small(seed=1), Errors(*torch.zeros(2, 128**2).unbind(0))
    with pytest.raises(ValueError, match="expected the configuration for which they were made"):
        ours.decide(state.densities, none, state.due.history, other, StageTimer())
    with pytest.raises(ValueError, match="expected the configuration for which they were made"):
        ours.reconstruct(state.cache, other, CYCLE_S)
    again = ours.decide(state.densities, none, state.due.history, small(), StageTimer())
    assert again.due.selected.numel() == 32


def test_a_set_of_stages_serves_several_runs_at_once() -> None:
    """The stages keep no state of a run: two interleaved runs equal two consecutive ones."""
    config = small(warmup_cycles=4)
    shared = compiled_stages(config)
    kinds = (pictures.textured_motion, pictures.static_stripes)

    def playing(picture, chosen):
        return runs.play("thesis", config, pictures.tracer(picture), fixed_clock(CYCLE_S), 0.0, 6 * CYCLE_S, chosen)

    alone = [[copy.copy(shown.image) for _, shown in playing(kind, compiled_stages(config))] for kind in kinds]
    turns = zip(*(playing(kind, shared) for kind in kinds), strict=True)
    for number, turn in enumerate(turns):
        for images, (_, shown) in zip(alone, turn, strict=True):
            assert torch.equal(shown.image, images[number])
