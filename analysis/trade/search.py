"""The search over all knobs together, by a tree-structured Parzen estimator for two aims.

Source: Ozaki et al. 2020, "Multiobjective tree-structured Parzen estimator for computationally expensive optimization
problems" (package ``optuna``). Nothing of it is kept on disk: a search of the same seed asks for the same settings as
long as they are measured alike, and runs on disk are not repeated.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from analysis.trade.knobs import OWN, Knob, Setting, Value, setting_of
from analysis.trade.runs import SEARCH, Point

if TYPE_CHECKING:
    import optuna

NOT_SEARCHED = ("policy", "structure", "packets", "latency-cycles", "light-cells")
"""Knobs that the search leaves alone: policies have knobs of their own, trees and packets change no picture, latency
costs nothing, and the built-in inputs have no light with an extent."""

Measure = Callable[[Sequence[Point]], list[tuple[float, float] | None]]
"""Cost and error of some points, over those of the default; None where a point cannot be measured."""


def searched(knobs: Sequence[Knob]) -> tuple[Knob, ...]:
    """Those of the knobs that a search turns."""
    return tuple(knob for knob in knobs if knob.policy == OWN and knob.name not in NOT_SEARCHED)


def search(knobs: Sequence[Knob], trials: int, at_once: int, seed: int, measure: Measure) -> list[Point]:
    """Settings that were tried, in order; the first is the default.

    Args:
        knobs: that are turned; of each the default and its values are tried.
        trials: how many settings.
        at_once: how many are asked for before any of them is measured.
        seed: of the search.
        measure: tells cost and error of settings.
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
    """Values in an order in which neighbours are alike: numbers by size, others as they are."""
    values = [knob.default, *knob.values]
    numbers = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)
    return sorted(values) if numbers else values  # type: ignore[type-var]


def _suggested(trial: optuna.Trial, knobs: Sequence[Knob]) -> Setting:
    values = {knob.name: _choices(knob)[trial.suggest_int(knob.name, 0, len(_choices(knob)) - 1)] for knob in knobs}
    return setting_of(OWN, values)
