"""A point on the measured front in place of settings: the choice, its predictions, and the measured values."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.command.console import Table
from analysis.comparison.front import Front, FrontPoint, stored_front
from analysis.comparison.options import CHOICES, RunOptions
from analysis.comparison.summary import Measured
from tsar.config import ConfigError

_SIDE_PX = 512
"""Side of the display for which batches on the front are given, pixels."""
CLOSE = 0.15
"""Relative difference between a prediction and its measurement above which the prediction counts as missed."""
_WORDS = {"flops": "FLOPs in all", "wall_s": "wall seconds of its cycles", "mse": "mean squared error"}


@dataclass(frozen=True)
class Choice:
    """A point on the front, for a run.

    Attributes:
        asked: the option that chose it, and its value.
        place: the point.
        predicted: ``flops``, ``wall_s`` and ``mse`` of the run.
        limit: the name and value of the limit that was asked for; None for a preset.
    """

    asked: str
    place: FrontPoint
    predicted: Mapping[str, float]
    limit: tuple[str, float] | None


def settled(options: RunOptions, front: Front | None = None) -> tuple[RunOptions, Choice | None]:
    """The options with the settings that they choose from the front; unchanged if they choose none.

    The simulated machine becomes as fast as the point needs, and rivals get the same machine.

    Raises:
        ConfigError: the point does not fit the resolution, or no point keeps the limit.
    """
    asked = next((name for name in CHOICES if getattr(options, name) not in ("", None)), None)
    if asked is None:
        return options, None
    place = _place(options, asked, front or stored_front())
    pixels = options.tsar.pixels
    capacity = place.flops[options.ledger] * pixels
    batch = max(1, round(place.batch * pixels / _SIDE_PX**2))
    value = getattr(options, asked)
    try:
        tsar = dataclasses.replace(options.tsar, batch_size=batch)
        free = dataclasses.replace(options, **{asked: RunOptions.__dataclass_fields__[asked].default})
        found = dataclasses.replace(free, tsar=tsar, capacity=capacity, parts=place.parts)
    except ConfigError as error:
        raise ConfigError(f"{asked}: expected a setting of the front that fits these options, got {error}") from error
    span = pixels * options.seconds
    predicted = {"flops": capacity * options.seconds, "wall_s": place.wall_s * span, "mse": place.mse}
    limits = {"budget_flops": "flops", "budget_seconds": "wall_s", "mse_target": "mse"}
    limit = (limits[asked], float(value)) if asked in limits else None
    if limit is not None and predicted[limit[0]] > limit[1] * (1.0 + 1e-9):
        least = f"{1.005 * predicted[limit[0]]:.3g}"  # not below it when it is rounded
        raise ConfigError(f"{asked}: expected at least {least}, the least of all settings of the front, got {value:g}")
    return found, Choice(f"{asked} {value if isinstance(value, str) else f'{value:g}'}", place, predicted, limit)


def _place(options: RunOptions, asked: str, front: Front) -> FrontPoint:
    span = options.tsar.pixels * options.seconds
    if asked == "preset":
        assert options.preset
        return front.preset(options.preset)
    if asked == "budget_flops":
        assert options.budget_flops is not None
        return front.within_flops(options.budget_flops / span, options.ledger)
    if asked == "budget_seconds":
        assert options.budget_seconds is not None
        return front.within_seconds(options.budget_seconds / span)
    assert options.mse_target is not None
    return front.at_error(options.mse_target)


def what_came(chosen: Choice, measured: Measured, capacity: float, seconds: float) -> dict[str, Any]:
    """The request, the setting, the predicted and the measured values, and their relative differences."""
    totals = measured.totals
    came = {
        "flops": capacity * seconds,
        "wall_s": totals.seconds_of(seconds),
        "mse": float(np.mean(measured.mse[measured.own])),
    }
    apart = {name: came[name] / said - 1.0 for name, said in chosen.predicted.items()}
    return {
        "asked": chosen.asked,
        "setting": chosen.place.words,
        "cost_over_default": chosen.place.cost,
        "error_over_default": chosen.place.error,
        "predicted": dict(chosen.predicted),
        "came": came,
        "apart": apart,
        "close": {name: abs(value) <= CLOSE for name, value in apart.items()},
        **({"limit": {chosen.limit[0]: chosen.limit[1]}} if chosen.limit else {}),
    }


def choice_table(found: Mapping[str, Any]) -> Table:
    """The choice as a table."""
    rows = [
        [
            *(_WORDS[name], f"{found['predicted'][name]:.3g}", f"{found['came'][name]:.3g}"),
            *(f"{100.0 * apart:+.0f} %", "" if found["close"][name] else "missed"),
        ]
        for name, apart in found["apart"].items()
    ]
    limit = "".join(f"; asked for at most {value:g} {_WORDS[name]}" for name, value in found.get("limit", {}).items())
    title = f"{found['asked']}: {found['setting']}{limit}"
    return Table(
        title, ["", "said", "came", "apart", ""], rows, note=f"Missed: apart by more than {100 * CLOSE:.0f} %."
    )
