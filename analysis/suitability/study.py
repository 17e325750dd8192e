"""The suitability study: five inputs, sixteen settings, repeated over seeds and phases; its cases and what they show.

Source: Stephens 2011, sec. 7.2.5.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from analysis.command import limits
from analysis.command.cluster import ClusterOptions
from analysis.metrics.cost_model import Ledger
from analysis.metrics.display_model import DisplayModel
from analysis.study.cases import INPUTS, ROWS, SCALES, Case, framed_config
from tsar.choices import SOLVERS
from tsar.config import TsarConfig, closed_choices, require
from tsar.policies import POLICIES


@dataclass(frozen=True)
@closed_choices()
class SuitabilityOptions:
    """Every run of table 7.2 at equal cost, beside the thesis' results. Runs that are on disk are not repeated."""

    inputs: tuple[str, ...] = INPUTS
    """Built-in inputs."""
    rows: tuple[int, ...] = tuple(range(len(ROWS)))
    """Rows of table 7.2, 0 to 15."""
    scale: Literal["thesis", "half", "quick"] = "quick"
    """thesis: its resolutions and batches. half: half the side, a quarter of the samples, tiles and machine. quick: a
    quarter of the side, against a reference half as often. All last 2 s."""
    repetitions: int = 3
    """Runs of each: repetition r has seed r and phase r / repetitions."""
    tsar: Annotated[TsarConfig, tyro.conf.arg(name=""), tyro.conf.OmitArgPrefixes] = field(default_factory=TsarConfig)
    """The adaptive pipeline; batch and resolution come from the row, the seed from the repetition."""
    policies: tuple[str, ...] = ("framed supersampled", "frameless", "afr", "oracle")
    """Policies that are compared beside TSAR and the framed renderer, at one row."""
    solvers: tuple[str, ...] = ("trivial",)
    """Solvers of TSAR that are compared beside the chosen one, at that row."""
    policy_row: int = 7
    """The row at which policies and solvers are compared."""
    ledger: Ledger = "thesis"
    """How cost is counted; wall is refused, for it gives no result twice."""
    framed_rate_hz: float = 8.0
    """Images a second that the framed renderer shows at every resolution; the machine is as fast as that takes."""
    trace_segments: float = 4.0
    """Ray segments per sample in the cost model."""
    start_s: float = 0.0
    """Where in the animation the measurement starts, seconds."""
    jod_repetitions: int = 1
    """Repetitions that ColorVideoVDP scores."""
    jod_span_s: tuple[float, float] = (0.4, 0.9)
    """Part of each that it scores, seconds after the start; a second of it costs more than the run."""
    display: DisplayModel = field(default_factory=DisplayModel)
    """The display it scores for."""
    farm: Annotated[ClusterOptions, tyro.conf.arg(name=""), tyro.conf.OmitArgPrefixes] = field(
        default_factory=ClusterOptions
    )
    """Where the runs are made."""
    out: Path = Path("out/suitability")
    """Folder for the results."""
    cache: Path = Path(".cache/reference")
    """Folder for references, shared by all runs."""

    def __post_init__(self) -> None:
        unknown = [one for one in self.inputs if one not in INPUTS]
        require(not unknown, "inputs", f"names out of {', '.join(INPUTS)}", unknown)
        for one in self.policies:
            POLICIES.require(one, "policies")
        for one in self.solvers:
            SOLVERS.require(one, "solvers")
        for name in ("inputs", "rows"):
            chosen = getattr(self, name)
            require(0 < len(chosen) == len(set(chosen)), name, "at least one, none twice", chosen)
        for name, values in (("rows", self.rows), ("policy_row", (self.policy_row,))):
            require(all(0 <= row < len(ROWS) for row in values), name, f"numbers from 0 to {len(ROWS) - 1}", values)
        limits.within(
            self,
            repetitions=limits.REPETITIONS,
            jod_repetitions=(0, limits.REPETITIONS[1]),
            framed_rate_hz=(0.01, 1000.0),
            trace_segments=limits.SEGMENTS,
            start_s=limits.TIMES_S,
            jod_span_s=(0.0, SCALES[self.scale].seconds),
        )
        self.display.repeats(SCALES[self.scale].reference_rate_hz)


@dataclass(frozen=True)
class Run:
    """A case and its place in the study.

    Attributes:
        label: who decides what is sampled: a policy, or ``tsar`` and a solver.
        row: of table 7.2; None for a framed renderer, which serves all rows of its resolution.
        side_px: output resolution.
        repetition: 0, 1, …
    """

    label: str
    row: int | None
    side_px: int
    repetition: int
    case: Case


STILLS = (0.35, 0.85)
"""Where in the run pictures are kept, as shares of its length."""


def runs(options: SuitabilityOptions) -> list[Run]:
    """Every run, framed ones once per resolution."""
    found = []
    for repetition, name in itertools.product(range(options.repetitions), options.inputs):
        found += _runs_of(options, name, repetition)
    return found


def _runs_of(options: SuitabilityOptions, name: str, repetition: int) -> Iterator[Run]:
    scale = SCALES[options.scale]
    rows = [(row, scale.config(row, dataclasses.replace(options.tsar, seed=repetition))) for row in options.rows]
    at_row = scale.config(options.policy_row, dataclasses.replace(options.tsar, seed=repetition))
    compared = [] if options.policy_row not in options.rows else options.policies

    def run(label: str, row: int | None, policy: str, config: TsarConfig) -> Run:
        case = Case(
            input=name,
            policy=policy,
            tsar=config,
            scale=scale,
            phase=repetition / options.repetitions,
            ledger=options.ledger,
            framed_rate_hz=options.framed_rate_hz,
            trace_segments=options.trace_segments,
            start_s=options.start_s,
            jod_span_s=options.jod_span_s if repetition < options.jod_repetitions else None,
            display=options.display,
            stills_s=tuple(share * scale.seconds for share in STILLS),
        )
        return Run(label, row, config.resolution_px, repetition, case)

    for side in sorted({config.resolution_px for _, config in rows}):
        yield run("framed", None, "framed", framed_config(side))
    for row, config in rows:
        yield run("tsar", row, "tsar", config)
    for policy in compared:
        if policy == "framed supersampled":
            yield run(policy, None, policy, framed_config(at_row.resolution_px))
        elif policy not in ("framed", "tsar"):
            yield run(policy, options.policy_row, policy, at_row)
    for solver in options.solvers if options.policy_row in options.rows else ():
        if solver != at_row.response.solver:
            changed = dataclasses.replace(at_row, response=dataclasses.replace(at_row.response, solver=solver))
            yield run(f"tsar {solver}", options.policy_row, "tsar", changed)
