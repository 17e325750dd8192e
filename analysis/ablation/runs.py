"""The runs of the study of parts."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from analysis.ablation.options import AblationOptions
from analysis.ablation.parts import WHOLE, Part
from analysis.study.cases import SCALES, Case, framed_config, is_framed
from analysis.study.inputs import phase_of


@dataclass(frozen=True)
class Run:
    """A case and its place in the study.

    Attributes:
        label: a part's words, :data:`analysis.ablation.parts.WHOLE`, or the name of a rival.
        row: of table 7.2.
        repetition: 0, 1, …
    """

    label: str
    row: int
    repetition: int
    case: Case


def rivals_of(options: AblationOptions) -> tuple[str, ...]:
    """The framed renderer, and the others."""
    return tuple(dict.fromkeys(("framed", *options.rivals)))


def runs(options: AblationOptions, parts: Sequence[Part]) -> list[Run]:
    """Every run; rows of one resolution share those of framed renderers."""
    places = itertools.product(range(options.repetitions), options.rows, options.inputs)
    return [run for repetition, row, name in places for run in _runs_at(options, parts, name, row, repetition)]


def _runs_at(options: AblationOptions, parts: Sequence[Part], name: str, row: int, repetition: int) -> Iterator[Run]:
    scale = SCALES[options.scale]
    config = scale.config(row, dataclasses.replace(options.tsar, seed=repetition))
    whole = Case(
        input=name,
        policy="tsar",
        tsar=config,
        scale=scale,
        phase=phase_of(name, repetition, options.repetitions),
        ledger=options.ledger,
        framed_rate_hz=options.framed_rate_hz,
        trace_segments=options.trace_segments,
        start_s=options.start_s,
        budget_s=options.before_s,
    )
    yield Run(WHOLE, row, repetition, whole)
    for part in parts:
        yield Run(part.words, row, repetition, dataclasses.replace(whole, parts=part.options, budget_s=None))
    for rival in rivals_of(options):
        used = framed_config(config.resolution_px) if is_framed(rival) else config
        yield Run(rival, row, repetition, dataclasses.replace(whole, policy=rival, tsar=used, budget_s=None))
