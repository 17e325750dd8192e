"""Measures points: those of single knobs all at once, those of the search as it requests them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from analysis.command.cli import bad_input, full_disk
from analysis.command.progress import bars
from analysis.metrics.front import means
from analysis.study import farm
from analysis.study.outcomes import Outcomes
from analysis.trade.knobs import Knob, KnobSetting, chosen_knobs
from analysis.trade.options import TradeOptions
from analysis.trade.runs import Point, Run, points_of, runs
from analysis.trade.search import search, searched
from analysis.trade.tables import RunResult

WRITTEN = (
    *("trade.csv", "tables/*.csv", "tables.md", "front.json", "report.html"),
    *("front.png", "knobs_*.png", "inputs.png"),
)


@dataclass
class Measurements:
    """The runs made so far. Changes in place.

    Attributes:
        outcomes: outcomes of their cases.
        runs: all requested runs, in order.
        dropped: settings that do not fit the scale, with reasons.
    """

    outcomes: Outcomes
    runs: list[Run]
    dropped: dict[str, str] = field(default_factory=dict)

    def result(self, run: Run) -> RunResult | None:
        """A run as read from disk; None if it failed."""
        summary = self.outcomes.summary(run.case)
        return None if summary is None else RunResult(run, summary, self.outcomes.times(run.case))

    def results(self) -> list[RunResult]:
        """Results of all runs that succeeded."""
        return [found for run in self.runs if (found := self.result(run)) is not None]


def measure(options: TradeOptions, knobs: Sequence[Knob]) -> Measurements:
    """Makes missing runs, those of single knobs first, with a progress bar for each part.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    with bad_input():
        planned, dropped = runs(options, points_of(knobs))
    outcomes = farm.run_study(options, [run.case for run in planned], WRITTEN)
    measured = Measurements(outcomes, planned, dropped)
    turned = searched(chosen_knobs(options.search_knobs) if options.search_knobs else knobs)
    if options.trials and turned:
        with full_disk(outcomes.place.results), bars() as shown:
            task = shown.task("search", options.trials)

            def costs_and_errors(points: Sequence[Point]) -> list[tuple[float, float] | None]:
                asked, dropped = runs(options, points)
                measured.dropped.update(dropped)
                measured.runs += asked
                outcomes.keep(*farm.run_cases([run.case for run in asked], outcomes.place, options.farm))
                task.advance(len(points))
                standing = _by_place(
                    measured, [run for run in measured.runs if run.point.setting == KnobSetting()], options
                )
                return [
                    _over(_by_place(measured, [run for run in asked if run.point is point], options), standing)
                    for point in points
                ]

            search(turned, options.trials, options.at_once, options.search_seed, costs_and_errors)
    return measured


CostAndError = tuple[float, float]


def _by_place(measured: Measurements, found: Sequence[Run], options: TradeOptions) -> dict[object, CostAndError]:
    """Cost and error of the runs of one setting, by scene, seed and phase."""
    pairs = {}
    for run in found:
        result = measured.result(run)
        if result is not None and result.summary["spent"]:
            pairs[run.where] = (
                result.summary["spent"]["flops"][options.ledger],
                float(result.times["mse"].to_numpy().mean()),
            )
    return pairs


def _over(here: dict[object, CostAndError], standing: dict[object, CostAndError]) -> CostAndError | None:
    """Geometric means of cost and error over those of the default; None unless all runs of the default have their
    pair."""
    if not standing or standing.keys() - here.keys():
        return None
    ratios = np.array([np.divide(here[where], standing[where]) for where in standing])
    cost, error = means(ratios.T)
    return float(cost), float(error)
