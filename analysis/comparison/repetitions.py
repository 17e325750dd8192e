"""Repetitions of a comparison over inputs, and over seeds or animation phases."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from analysis.command import limits
from analysis.command.console import Table
from analysis.command.options import Unprefixed
from analysis.comparison.options import DEFAULT_POLICY, RunOptions
from analysis.metrics.cost_model import Ledger
from analysis.study.asked import require_inputs
from analysis.study.inputs import INPUTS, phase_of
from tsar.config import TsarConfig, closed_choices, require


@dataclass(frozen=True)
@closed_choices()
class InputsOptions:
    """The inputs, and the number of repetitions. Runs that are complete in the folder are not repeated."""

    inputs: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[INPUT ...]")] = INPUTS
    """Built-in inputs, or other scenes by their names."""
    vary: Literal["seed", "phase"] = "seed"
    """What differs between repetitions: the seed (0, 1, …) or the phase (0, 1/n, …)."""
    repetitions: int = 3
    """Repetitions of each; runs of an input, which differ in what vary names."""
    tsar: Unprefixed[TsarConfig] = field(default_factory=TsarConfig)
    """Size, batch and seed of all policies, and the pipeline of the policy thesis; repetitions set the seed if seeds
    vary."""
    policy: str = DEFAULT_POLICY
    """Policy that decides what is sampled, by name."""
    rivals: tuple[str, ...] = ("framed", "framed-1", "framed-super")
    """Rivals at equal cost; ratios are to the first."""
    seconds: float = 2.0
    """Animation time to measure, seconds."""
    ledger: Ledger = "thesis"
    """How cost is counted; wall takes measured time in place of simulated time."""
    capacity: float | None = None
    """Speed of the simulated machine, FLOP/s. By default 8 framed images a second at every size."""
    reference_rate_hz: float = 30.0
    """Reference images per simulated second; half as many as run.py has, because references take most of the time."""
    out: Path = Path("out/inputs")
    """Folder for the results; it gets one folder a run."""

    def __post_init__(self) -> None:
        limits.within(self, repetitions=limits.REPETITIONS)
        require(len(self.rivals) >= 1, "rivals", "at least one", self.rivals)
        require(len(self.inputs) >= 1, "inputs", "at least one", self.inputs)
        require_inputs(self.inputs)
        self.runs()

    def runs(self) -> list[RunOptions]:
        """The resolved options of every run."""
        found = []
        for name in self.inputs:
            for number in range(self.repetitions):
                out = self.out / f"{name}-{self.vary}{number}"
                by_phase = self.vary == "phase"
                found.append(
                    RunOptions(
                        input=name,
                        tsar=self.tsar if by_phase else dataclasses.replace(self.tsar, seed=number),
                        phase=phase_of(name, number, self.repetitions) if by_phase else 0.0,
                        policy=self.policy,
                        rivals=self.rivals,
                        seconds=self.seconds,
                        ledger=self.ledger,
                        capacity=self.capacity,
                        reference_rate_hz=self.reference_rate_hz,
                        film=False,
                        out=out,
                    )
                )
        return found


def row(run: RunOptions, summary: Mapping[str, Any]) -> dict[str, Any]:
    """The row of one run in a table over runs."""
    names = ("ratio_median", "ratio_quartiles", "share_suitable", "suitable_percentile", "cycles", "age_spread_s")
    beside = dict(summary["ratio_statistics"])
    if "best_rival" in summary:
        from analysis.metrics.rivals import BEST  # here, because it imports torch

        beside[BEST] = summary["best_rival"]["ratio_statistics"]
    return {
        "run": run.out.name,
        "input": run.input,
        "seed": run.tsar.seed,
        "phase": run.phase,
        **{name: summary[name] for name in names},
        "ratio_medians": {name: statistics["median"] for name, statistics in beside.items()},
        "invariants_ok": summary["invariants"] is None or summary["invariants"]["ok"],
        "stage_wall_s": summary["stage_wall_s"],
    }


def ratio_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """Error ratios of all runs."""
    lines, names = [], list(rows[0]["ratio_medians"])
    for found in rows:
        low, high = found["ratio_quartiles"]
        ratios = (f"{found['ratio_median']:.3f}", f"{low:.3f} – {high:.3f}")
        others = (f"{found['ratio_medians'][name]:.3f}" for name in names[1:])
        lines.append((found["run"], *ratios, f"{found['suitable_percentile']:.0f}", *others))
    title = f"MSE ratio to {names[0]}, and its median to others"
    return Table(title, ("run", "median", "quartiles", "suitable percentile", *names[1:]), lines)
