"""The compiled stages ignore nothing that the reference supports: unknown choices and fields run in the reference."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Literal, get_args

import pytest
import torch

import tsar.accounting
import tsar.decision
import tsar.error
from renderer.stages.control import Control, compiled_stages
from renderer.stages.coverage import _KNOWN, _OPTIONS, StageName, covered, covers
from renderer.stages.reconstruction import Reconstructor
from tests.oracles import pictures, runs
from tests.renderer.stages.builders import CONFIGS, CYCLE_S, small
from tsar.choices import NORMS, RECONSTRUCTIONS, SOLVERS
from tsar.config import (
    ErrorConfig,
    ReconstructionConfig,
    ResponseConfig,
    TilingConfig,
    TsarConfig,
    closed_choices,
)
from tsar.filtering.options import DEFAULT, FilterOptions
from tsar.filtering.stages import FilterStages
from tsar.norms import total_power
from tsar.policies.thesis import State
from tsar.policy import Cycle, Moment, step
from tsar.reconstruction import blend
from tsar.response.transport import waterfill
from tsar.stages import REFERENCE, Stages

STAGES: tuple[StageName, ...] = get_args(StageName)


@dataclass(frozen=True)
class MoreErrors(ErrorConfig):
    form: Literal["contrast", "difference", "ratio"] = "contrast"  # type: ignore[assignment]


@dataclass(frozen=True)
class MoreTilings(TilingConfig):
    order: Literal["morton", "reversed"] = "morton"


@dataclass(frozen=True)
@closed_choices()
class MoreSettings(TsarConfig):
    unheard_of: int = 0


def replay(config: TsarConfig, stages: Stages, cycles: int = 3) -> list[Cycle[State]]:
    policy, trace, found = runs.made("thesis", config, stages), pictures.tracer(pictures.textured_motion), []
    state = policy.start()
    for number in range(cycles):
        found.append(step(policy, state, trace, Moment(number * CYCLE_S, number, CYCLE_S)))
        state = found[-1].after
    return found


def assert_handed_over(config: TsarConfig, known: TsarConfig, stage: StageName, exact: bool = True) -> None:
    """The compiled stages agree with the reference on a configuration, and its result differs from that of a known
    one."""
    assert not covers(config, stage) and covers(known, stage)
    ours, theirs, other = (replay(*case) for case in ((config, compiled_stages(config)), (config, REFERENCE),
                                                      (known, compiled_stages(known))))  # fmt: skip
    seen = {
        "observe": lambda at: at.after.errors.spatial,
        "respond": lambda at: at.after.densities.spatial,
        "reconstruct": lambda at: at.shown.image,
    }[stage]
    close = {"rtol": 0.0, "atol": 0.0} if exact else {"rtol": 1e-4, "atol": 1e-4}
    # later cycles also see the rounding of the stages that decide
    for one, two in list(zip(ours, theirs, strict=True))[: 1 if exact else None]:
        torch.testing.assert_close(seen(one), seen(two), **close)
    assert any((seen(one) - seen(two)).abs().max() > 1e-2 for one, two in zip(ours, other, strict=True))


@pytest.fixture(autouse=True)
def made_up(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Adds to the reference the norm ``l1``, the form ``ratio``, the solver ``half``, and negatives of its images."""
    error = tsar.error.signed_error

    def signed_error(bands, config):
        return -error(bands, config) if config.form == "ratio" else error(bands, config)

    def rooted(squared, repeat):
        return total_power(squared, repeat).sqrt()

    def half(desired, bound, surplus, surplus_max):
        return 0.5 * waterfill(desired, bound, surplus, surplus_max)

    def negative(cache, config, cycle_s):
        made = blend(cache, config, cycle_s)
        return replace(made, image=-made.image)

    monkeypatch.setattr(tsar.error, "signed_error", signed_error)
    with NORMS.lent(l1=rooted), SOLVERS.lent(half=half), RECONSTRUCTIONS.lent(negative=negative):
        yield


@pytest.mark.parametrize("error", [{"norm": "l1"}, {"form": "ratio"}, {"estimator": "variance"}, {"estimator": "fft"}])
def test_an_error_that_is_not_compiled_is_estimated_by_the_reference(error: dict) -> None:
    assert_handed_over(small(error=MoreErrors(**error)), small(), "observe")


def test_a_solver_that_is_not_compiled_is_the_references() -> None:
    assert_handed_over(small(response=ResponseConfig(solver="half")), small(), "respond", exact=False)


def test_a_reconstruction_that_is_not_compiled_is_the_references() -> None:
    negative = small(reconstruction=ReconstructionConfig(method="negative"))
    assert_handed_over(negative, small(), "reconstruct", exact=False)


@pytest.mark.parametrize(
    "config", [small(tiling=MoreTilings()), MoreSettings(batch_size=32, resolution_px=256)], ids=["tiling", "run"]
)
def test_a_field_that_no_stage_knows_goes_to_the_reference_throughout(config: TsarConfig) -> None:
    assert not any(covers(config, stage) for stage in STAGES)
    called = []

    def heard(name: str):
        return lambda *arguments: called.append(name)

    original = {field.name: getattr(REFERENCE, field.name) for field in fields(REFERENCE)}
    control, reconstructor = Control(config), Reconstructor(config)
    try:
        for name in original:
            object.__setattr__(REFERENCE, name, heard(name))
        control.observe(None, None, None, config, None)
        control.decide(None, None, None, config, None)
        control.account(None, None, None, config)
        reconstructor.reconstruct(None, config, 1.0)
    finally:
        for name, stage in original.items():
            object.__setattr__(REFERENCE, name, stage)
    assert called == ["observe", "decide", "account", "reconstruct"]


@pytest.mark.parametrize("name", CONFIGS)
def test_everything_that_there_is_today_is_compiled(name: str) -> None:
    """Except for solvers that are not compiled; a new field must not make all runs slow unnoticed."""
    assert all(covers(CONFIGS[name], stage) for stage in STAGES)
    for solver in SOLVERS:
        config = replace(CONFIGS[name], response=replace(CONFIGS[name].response, solver=solver))
        assert covers(config, "respond") == (solver == "waterfill") and covers(config, "decide")


@dataclass(frozen=True)
class MoreOptions(FilterOptions):
    unheard_of: int = 0


def test_options_that_the_filter_is_not_compiled_for_go_to_the_reference() -> None:
    def saying(said: str) -> FilterStages:
        return FilterStages(chosen=lambda *arguments: said, taken_in=lambda *arguments: said)  # type: ignore[arg-type]

    stages, nothing = covered(saying("compiled"), saying("reference")), [None] * 6
    for options, expected in (
        (DEFAULT, ("compiled", "compiled")),
        (replace(DEFAULT, wavelets=True), ("compiled", "reference")),
        (MoreOptions(), ("reference", "reference")),
    ):
        assert (stages.chosen(*nothing, options), stages.taken_in(*nothing[:4], options)) == expected  # type: ignore


def test_what_is_known_is_there() -> None:
    assert {field.name for field in fields(FilterOptions)} == _OPTIONS.keys()
    config = TsarConfig()
    for name, known in _KNOWN.items():
        record = getattr(config, name) if name else config
        assert is_dataclass(record) and known.keys() == {field.name for field in fields(record)}
