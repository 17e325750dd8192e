"""Policies whose state is kept in other formats between their stages."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest
import torch
from torch import Tensor

from renderer.stages.control import stages
from tests.tsar.policies.test_behaviour import CONFIG, CYCLE_S
from tests.tsar.policies.test_clocks import moving
from tsar.checks import ConfigError
from tsar.formats import rounded
from tsar.policies import POLICIES
from tsar.policies.stored import ALL, FIELDS, Stored
from tsar.policy import Moment, Policy, Setting, step

KEPT = {
    "tsar": ("samples", "colors", "variances", "change", "points", "places", "times", "picture"),
    "thesis": ("samples", "colors", "wavelets", "errors", "densities", "times", "picture"),
}
SCREEN = moving(0.0, 4.0)
SETTING = Setting(CONFIG, lambda config: stages(config, "compiled", 1), view=SCREEN.view)


def cycles(policy: Policy[Any]) -> tuple[Tensor, Any]:
    """Pictures of some cycles of a moving scene, and the last state."""
    shown, state = [], policy.start()
    for cycle in range(8 if policy.latency_cycles == 1 else 30):
        done = step(policy, state, SCREEN.trace, Moment(cycle * CYCLE_S, cycle, CYCLE_S))
        state = done.after
        shown.append(done.shown.image)
    return torch.stack(shown), state


@cache
def own(policy: str) -> tuple[Tensor, Any]:
    """The same of a policy as it is."""
    return cycles(POLICIES[policy](SETTING))


def found(state: Any, field: str) -> Tensor:
    for name in field.split("."):
        state = getattr(state, name)
    return state


@pytest.mark.parametrize("policy", KEPT)
def test_the_own_formats_change_nothing(policy: str) -> None:
    formats = {kept: "float32" for kept in KEPT[policy] if kept not in ("times", "densities")}
    assert torch.equal(cycles(Stored(SETTING, POLICIES[policy], formats))[0], own(policy)[0])


@pytest.mark.parametrize(("policy", "kept"), [(policy, kept) for policy, names in KEPT.items() for kept in names])
def test_what_is_kept_is_held_in_the_format_and_has_a_use(policy: str, kept: str) -> None:
    form = "bfloat16" if kept == "densities" else "float8"
    shown, state = cycles(Stored(SETTING, POLICIES[policy], {kept: form}))
    assert shown.isfinite().all()
    usual, after = own(policy)
    same = torch.equal(shown, usual)
    if policy == "thesis":
        same = same and torch.equal(state.densities.combined(), after.densities.combined())
    assert not same
    for field in FIELDS[kept]:
        if field.split(".")[0] in ("estimates", "surfels", "change", "drift_s", "rate") and policy == "tsar":
            assert torch.equal(rounded(found(state, field), form), found(state, field)), field
        if field.split(".")[0] in ("cache", "densities") and policy == "thesis":
            assert torch.equal(rounded(found(state, field), form), found(state, field)), field


@pytest.mark.parametrize("policy", KEPT)
def test_in_float64_pictures_agree_within_rounding(policy: str) -> None:
    double, state = cycles(Stored(SETTING, POLICIES[policy], {ALL: "float64"}))
    field = "estimates.color" if policy == "tsar" else "cache.color"
    assert found(state, field).dtype == torch.float64
    assert (double - own(policy)[0]).abs().max() < 1e-4


@pytest.mark.parametrize(
    ("policy", "formats", "message"),
    [
        ("tsar", {"hearts": "float16"}, "formats: .*variances.*'hearts'"),
        ("tsar", {"colors": "int3"}, "formats.colors: .*bfloat16.*'int3'"),
        ("tsar", {"densities": "float32"}, "formats.densities: .*a field that the policy has.*'filter'"),
        ("thesis", {"points": "float16"}, "formats.points: .*a field that the policy has.*'thesis'"),
    ],
)
def test_formats_that_do_not_fit_are_refused(policy: str, formats: dict[str, str], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Stored(SETTING, POLICIES[policy], formats)
