"""Presets and budgets: the options that they set, and predicted and measured values."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
import pytest

from analysis.comparison.choosing import choice_table, settled, what_came
from analysis.comparison.front import Front, FrontPoint, PresetName, stored_front
from analysis.comparison.options import RunOptions
from analysis.metrics.cost_model import MODELLED
from tsar.config import ConfigError, TsarConfig


def place(batch: int, cost: float, error: float, knee: bool = False, **parts: float) -> FrontPoint:
    flops = {name: 1e5 * cost for name in (*MODELLED, "work")}
    return FrontPoint(batch, tuple(sorted(parts.items())), flops, 1e-5 * cost, 1e-3 * error, cost, error, knee)


FRONT = Front(
    (place(16, 0.2, 3.0), place(64, 0.5, 1.5), place(128, 1.0, 1.0, True, reach=0.25), place(512, 3.5, 0.5)), {}
)
SMALL = RunOptions("fly-by", tsar=TsarConfig(resolution_px=256), seconds=0.5)
SPAN = 256**2 * 0.5


def asked(**choice: Any) -> RunOptions:
    return dataclasses.replace(SMALL, **choice)


@pytest.mark.parametrize(
    ("choice", "expected"),
    [
        ({"preset": "draft"}, 0), ({"preset": "balanced"}, 2), ({"preset": "accurate"}, 3),
        ({"budget_flops": 0.99e5 * SPAN}, 1), ({"budget_seconds": 1.01e-5 * SPAN}, 2), ({"mse_target": 1.1e-3}, 2),
    ],
)  # fmt: skip
def test_a_choice_sets_machine_batch_and_parts(choice: dict[str, Any], expected: int) -> None:
    wanted = FRONT.places[expected]
    options, chosen = settled(asked(**choice), FRONT)
    assert chosen is not None and chosen.place == wanted
    assert options.tsar.batch_size == wanted.batch // 4 and options.parts == wanted.parts
    assert options.capacity == pytest.approx(1e5 * wanted.cost * 256**2)
    assert chosen.predicted == pytest.approx(
        {"flops": 1e5 * wanted.cost * SPAN, "wall_s": 1e-5 * wanted.cost * SPAN, "mse": wanted.mse}
    )
    assert settled(options, FRONT) == (options, None), "what is settled chooses nothing"


@pytest.mark.parametrize(("name", "value"), [("budget_flops", 1.0), ("budget_seconds", 1e-6), ("mse_target", 1e-6)])
def test_a_limit_that_no_setting_keeps_is_refused(name: str, value: float) -> None:
    """With the least that one does, which is taken then."""
    with pytest.raises(ConfigError, match=f"^{name}: expected at least .*, got {value:g}$") as caught:
        settled(asked(**{name: value}), FRONT)
    least = float(str(caught.value).split()[4].rstrip(","))
    chosen = settled(asked(**{name: least}), FRONT)[1]
    assert chosen is not None and chosen.place == (FRONT.places[-1] if name == "mse_target" else FRONT.places[0])


def test_without_a_choice_nothing_changes() -> None:
    assert settled(SMALL, FRONT) == (SMALL, None)


def test_what_came_is_set_beside_what_was_said() -> None:
    options, chosen = settled(asked(mse_target=1.1e-3), FRONT)
    assert chosen is not None
    totals = SimpleNamespace(seconds_of=lambda span_s: chosen.predicted["wall_s"] * 2.0)
    measured: Any = SimpleNamespace(own="tsar", mse={"tsar": np.array([1.0e-3, 1.2e-3])}, totals=totals)
    found = what_came(chosen, measured, options.capacity, options.seconds)
    assert found["asked"] == "mse_target 0.0011" and found["limit"] == {"mse": 1.1e-3}
    assert found["apart"] == pytest.approx({"flops": 0.0, "wall_s": 1.0, "mse": 0.1})
    assert found["close"] == {"flops": True, "wall_s": False, "mse": True}
    rows = {row[0]: row[1:] for row in choice_table(found).rows}
    assert rows["wall seconds of its cycles"][2:] == ["+100 %", "missed"] and rows["mean squared error"][3] == ""


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"preset": "draft", "mse_target": 0.1}, "preset: expected only one of preset, budget_flops"),
        ({"preset": "draft", "policy": "thesis"}, "policy: expected tsar beside a preset"),
        ({"budget_flops": 1e9, "capacity": 1e9}, "capacity: expected none beside a budget_flops"),
        ({"budget_seconds": 1.0, "ledger": "wall"}, "ledger: expected a modelled one"),
        ({"budget_seconds": 0.0}, "budget_seconds: expected between"),
        ({"mse_target": 2.0}, "mse_target: expected between"),
        ({"preset": "fast"}, "preset: expected"),
        ({"parts": (("reach", 0.1),), "policy": "thesis"}, "parts: expected none but of tsar"),
    ],
)
def test_bad_choices_are_refused(choice: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=f"^{message}"):
        asked(**choice)


def test_the_stored_front_is_one() -> None:
    front = stored_front()
    costs, errors = ([getattr(place, name) for place in front.places] for name in ("cost", "error"))
    assert costs == sorted(costs) and errors == sorted(errors, reverse=True)
    draft, balanced, accurate = (front.preset(name) for name in get_args(PresetName))
    assert draft.cost <= balanced.cost <= accurate.cost and draft.mse >= balanced.mse >= accurate.mse
    for name in get_args(PresetName):
        assert settled(RunOptions("fly-by", preset=name))[0].parts == front.preset(name).parts
