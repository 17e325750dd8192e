"""The runs of the suitability study: five inputs at sixteen settings, repeated over seeds and phases.

Source: Stephens 2011, sec. 7.2.5.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from analysis.study.cases import SCALES, Case, framed_config, is_framed
from analysis.study.inputs import phase_of
from analysis.suitability.options import SuitabilityOptions
from tsar.config import TsarConfig


@dataclass(frozen=True)
class Run:
    """A case and its place in the study.

    Attributes:
        label: name of the policy, or ``thesis`` and a solver.
        row: row of table 7.2; None for a framed renderer, whose run serves all rows of its resolution.
        side_px: output resolution.
        repetition: 0, 1, …
    """

    label: str
    row: int | None
    side_px: int
    repetition: int
    case: Case


STILLS = (0.35, 0.85)
"""Times at which pictures are kept, as shares of the length of a run."""


def runs(options: SuitabilityOptions) -> list[Run]:
    """Every run, with framed ones once per resolution."""
    found = []
    for repetition, name in itertools.product(range(options.repetitions), options.inputs):
        found += _runs_of(options, name, repetition)
    return found


def _runs_of(options: SuitabilityOptions, name: str, repetition: int) -> Iterator[Run]:
    scale = dataclasses.replace(SCALES[options.scale], stride=options.metric_stride)
    rows = [(row, scale.config(row, dataclasses.replace(options.tsar, seed=repetition))) for row in options.rows]
    at_row = scale.config(options.policy_row, dataclasses.replace(options.tsar, seed=repetition))
    everywhere = dict.fromkeys(("framed", *options.policies, *options.rivals))
    at_one = [] if options.policy_row not in options.rows else [one for one in options.beside if one not in everywhere]

    def run(label: str, row: int | None, policy: str, config: TsarConfig) -> Run:
        case = Case(
            input=name,
            policy=policy,
            tsar=config,
            scale=scale,
            phase=phase_of(name, repetition, options.repetitions),
            ledger=options.ledger,
            framed_rate_hz=options.framed_rate_hz,
            trace_segments=options.trace_segments,
            start_s=options.start_s,
            jod_span_s=options.jod_span_s if repetition < options.jod_repetitions else None,
            display=options.display,
            stills_s=tuple(share * scale.seconds for share in STILLS),
        )
        return Run(label, row, config.resolution_px, repetition, case)

    def runs_at(policy: str, places: Sequence[tuple[int, TsarConfig]]) -> Iterator[Run]:
        if is_framed(policy):
            for side in sorted({config.resolution_px for _, config in places}):
                yield run(policy, None, policy, framed_config(side))
        else:
            for row, config in places:
                yield run(policy, row, policy, config)

    for policy in everywhere:
        yield from runs_at(policy, rows)
    for policy in at_one:
        yield from runs_at(policy, [(options.policy_row, at_row)])
    for solver in options.solvers if "thesis" in everywhere and options.policy_row in options.rows else ():
        if solver != at_row.response.solver:
            changed = dataclasses.replace(at_row, response=dataclasses.replace(at_row.response, solver=solver))
            yield run(f"thesis {solver}", options.policy_row, "thesis", changed)
