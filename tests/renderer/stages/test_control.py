"""Compiled control stages against the tensor operations that define them."""

from __future__ import annotations

import copy

import jaxtyping
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.stages.control import Control, compiled_stages, stages
from tests.oracles import pictures, runs
from tests.oracles.batches import make_batch
from tests.renderer.stages.builders import CONFIGS, CYCLE_S, moments, small
from tsar import response
from tsar.cache import FrameletCache
from tsar.choices import SOLVERS
from tsar.clock import StageTimer, fixed_clock
from tsar.config import ResponseConfig, TilingConfig, TsarConfig
from tsar.decision import Decision
from tsar.response import initial_densities
from tsar.selection import Request, initial_history, request
from tsar.stages import REFERENCE
from tsar.tiling import build, uniform
from tsar.types import Densities, Errors, SampleBatch, Tiling

CACHE_FIELDS = ("level", "index", "time_s", "dead", "color", "coefficients", "slot_of_node")


def same_tiling(ours: Tiling, theirs: Tiling) -> bool:
    return torch.equal(ours.level, theirs.level) and torch.equal(ours.index, theirs.index)


def assert_same_densities(ours: Densities, theirs: Densities, config: TsarConfig) -> None:
    # near a double root of its quadratic an element moves by the square root of the rounding
    torch.testing.assert_close(ours.spatial, theirs.spatial, rtol=1e-7, atol=0.0)
    torch.testing.assert_close(ours.temporal, theirs.temporal, rtol=1e-7, atol=0.0)
    assert abs(ours.surplus - theirs.surplus) <= 1e-12 * config.budget


def assert_same_cache(ours: FrameletCache, theirs: FrameletCache) -> None:
    for field in CACHE_FIELDS:
        if field == "coefficients":
            torch.testing.assert_close(ours.coefficients, theirs.coefficients, rtol=0.0, atol=1e-6)
        else:
            assert torch.equal(getattr(ours, field), getattr(theirs, field)), field


def assert_same_request(ours: Request, theirs: Request) -> None:
    for field in ("selected", "history", "level", "index", "position"):
        assert torch.equal(getattr(ours, field), getattr(theirs, field)), field


def decided_by_reference(densities: Densities, history: torch.Tensor, config: TsarConfig) -> Decision:
    """What follows from densities that are given."""
    tiling = build(densities.spatial, config)
    return Decision(densities, tiling, request(tiling, densities.temporal, history, config))


def decided(densities: Densities, history: torch.Tensor, config: TsarConfig) -> Decision:
    """The same by the compiled stages: a batch without errors changes no density."""
    none = Errors(*torch.zeros(2, config.sdf_side**2).unbind(0))
    return Control(config).decide(densities, none, history, config, StageTimer())


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
        torch.testing.assert_close(found.errors.spatial, wanted.errors.spatial, rtol=0.0, atol=2e-5)
        torch.testing.assert_close(found.errors.temporal, wanted.errors.temporal, rtol=0.0, atol=2e-5)
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
    """Nothing is requested that was not chosen, whatever let such a configuration through."""
    config = small()
    object.__setattr__(config.tiling, "tile_count_max", 31)
    even = torch.ones(128**2, dtype=torch.float64)
    for decide in (decided, decided_by_reference):
        with pytest.raises(ValueError, match="at least 32 tiles, a full batch, got 31"):
            decide(Densities(even, even), even, config)


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


def errors_of(kind: str, g: torch.Generator, elements: int) -> Errors:
    noise = 2 * torch.rand(2, elements, generator=g) - 1
    noise[:, torch.rand(elements, generator=g) < 0.6] = 0.0
    if kind == "all ask":
        noise = noise.abs()
    if kind == "all free":
        noise = -noise.abs()
    if kind == "few ask much":
        noise = torch.where(torch.rand(elements, generator=g) < 0.01, noise.abs(), -1e-3 * noise.abs())
    if kind == "none":
        noise.zero_()
    return Errors(noise[0].contiguous(), noise[1].contiguous())


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    kind=st.sampled_from(["mixed", "all ask", "all free", "few ask much", "none"]),
    surplus_max=st.sampled_from([0.0, 0.1, 1.0]),
    bias=st.sampled_from([0.0, 0.5, -2.0]),
)
def test_decisions_agree(seed: int, kind: str, surplus_max: float, bias: float) -> None:
    """From states that decisions before them made, some at the walls, with much or no surplus."""
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


def test_five_thousand_decisions_do_not_drift(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    config = TsarConfig(sdf_side=16, resolution_px=128, batch_size=16)
    control, g = Control(config), torch.Generator().manual_seed(11)
    densities, history = initial_densities(config), initial_history(config)
    (low_s, high_s), (low_t, high_t) = config.spatial_bounds, config.temporal_bounds
    for cycle in range(5000):
        noise = torch.rand(3, 256, generator=g)
        drift = 0.3 * torch.sin(torch.tensor(cycle / 500.0))
        field = torch.where(noise[2] < 0.4, (2 * noise[:2] - 1 + drift).clamp(-1, 1), 0.0)
        decision = control.decide(densities, Errors(field[0], field[1]), history, config, StageTimer())
        densities, history = decision.densities, decision.due.history
        assert 0.0 <= densities.surplus <= config.response.surplus_max * config.budget * (1 + 1e-9)
    assert abs(float(densities.combined().sum()) + densities.surplus - config.budget) <= 1e-9 * config.budget
    assert low_s * (1 - 1e-12) <= densities.spatial.min() and densities.spatial.max() <= high_s * (1 + 1e-12)
    assert low_t * (1 - 1e-12) <= densities.temporal.min() and densities.temporal.max() <= high_t * (1 + 1e-12)


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


def test_the_stages_are_chosen_by_name() -> None:
    assert stages(small(), "reference") is REFERENCE
    assert stages(small()).decide != REFERENCE.decide


def test_stages_refuse_another_configuration_than_theirs() -> None:
    ours, state = compiled_stages(small()), runs.made("thesis", small()).start()
    other, none = small(seed=1), Errors(*torch.zeros(2, 128**2).unbind(0))
    with pytest.raises(ValueError, match="expected the configuration that they were made for"):
        ours.decide(state.densities, none, state.due.history, other, StageTimer())
    with pytest.raises(ValueError, match="expected the configuration that they were made for"):
        ours.reconstruct(state.cache, other, CYCLE_S)
    again = ours.decide(state.densities, none, state.due.history, small(), StageTimer())
    assert again.due.selected.numel() == 32


def test_larger_batches_than_the_configuration_says_are_refused() -> None:
    config = small()
    batch = make_batch(uniform(3), torch.arange(33), 0.0, 0, config)
    with pytest.raises(ValueError, match="expected at most 32 framelets, got 33"):
        compiled_stages(config).observe(batch, torch.zeros(33, 256, 3), FrameletCache(config), config, StageTimer())


def test_a_set_of_stages_serves_several_runs_at_once() -> None:
    """Nothing of a run stays in it: two that take turns come out as one after the other."""
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
