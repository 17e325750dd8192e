"""The search over all knobs together, by a tree-structured Parzen estimator for two objectives.

Source: Ozaki et al. 2020, "Multiobjective tree-structured Parzen estimator for computationally expensive optimization
problems" (package ``optuna``). The state of the search is not stored: with the same seed it requests the same settings
as long as their measurements are the same, and runs on disk are not repeated.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from analysis.trade.knobs import OWN, Knob, KnobSetting, Value, setting_of
from analysis.trade.runs import SEARCH, Point

if TYPE_CHECKING:
    import optuna

NOT_SEARCHED = ("policy", "structure", "packets", "latency-cycles", "light-cells")
"""Knobs that the search does not turn: policies have their own knobs, trees and packets change no picture, latency
costs nothing, and the built-in inputs have no area light."""

MeasurePoints = Callable[[Sequence[Point]], list[tuple[float, float] | None]]
"""Cost and error of points over those of the default; None for a point that cannot be measured."""


def searched(knobs: Sequence[Knob]) -> tuple[Knob, ...]:
    """Those of the knobs that the search turns."""
    return tuple(knob for knob in knobs if knob.policy == OWN and knob.name not in NOT_SEARCHED)


def search(knobs: Sequence[Knob], trials: int, at_once: int, seed: int, measure: MeasurePoints) -> list[Point]:
    """The settings that were tried, in order; the first is the default.

    Args:
        knobs: knobs to turn, each to its default and its further values.
        trials: number of settings.
        at_once: number of settings that are requested before any of them is measured.
        seed: seed of the search.
        measure: measures cost and error of settings.
    """
    import optuna
    from optuna.trial import TrialState

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.TPESampler(seed=seed, n_startup_trials=2 * at_once, constant_liar=True)
    study = optuna.create_study(directions=["minimize", "minimize"], sampler=sampler)
    study.enqueue_trial({knob.name: _choices(knob).index(knob.default) for knob in knobs})
    found = list[Point]()
    for count in _generations(trials, at_once):
        asked = [study.ask() for _ in range(count)]
        points = [Point(SEARCH, trial.number, _suggested(trial, knobs)) for trial in asked]
        for trial, values in zip(asked, measure(points), strict=True):
            if values is None:
                study.tell(trial, state=TrialState.FAIL)
            else:
                study.tell(trial, [math.log(value) for value in values])
        found += points
    return found


def _generations(trials: int, at_once: int) -> Iterator[int]:
    return (min(at_once, trials - done) for done in range(0, trials, at_once))


def _choices(knob: Knob) -> list[Value]:
    """Values in an order in which neighbours are similar: numbers by size, others unchanged."""
    values = [knob.default, *knob.values]
    numbers = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)
    return sorted(values) if numbers else values  # type: ignore[type-var]


def _suggested(trial: optuna.Trial, knobs: Sequence[Knob]) -> KnobSetting:
    values = {knob.name: _choices(knob)[trial.suggest_int(knob.name, 0, len(_choices(knob)) - 1)] for knob in knobs}
    return setting_of(OWN, values)
