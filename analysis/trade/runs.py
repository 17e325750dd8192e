"""The runs of the measurement of the trade."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable
from dataclasses import dataclass

from analysis.study.cases import SCALES, Case, Scale
from analysis.study.fitting import fitting
from analysis.study.inputs import INPUTS, phase_of
from analysis.trade.knobs import OWN, ROW, Knob, KnobSetting, Value, Where, alone, case_of
from analysis.trade.options import TradeOptions
from tsar.config import ConfigError, TsarConfig

SEARCH = "search"
"""Stands in place of a knob for the search over all knobs together."""


@dataclass(frozen=True)
class Point:
    """A setting, and the reason for measuring it.

    Attributes:
        knob: name of the knob that is turned, or :data:`SEARCH`.
        value: value of the knob; for the search, the number of the trial.
        setting: setting of all knobs.
    """

    knob: str
    value: Value
    setting: KnobSetting


@dataclass(frozen=True)
class Run:
    """A point under given conditions, as a case."""

    point: Point
    where: Where
    case: Case


def points_of(knobs: Iterable[Knob]) -> list[Point]:
    """Every value of every knob with all others at their defaults, and always the default of the policy ``tsar``."""
    found = [Point(knob.name, value, setting) for knob in knobs for value, setting in alone(knob)]
    if all(point.setting != KnobSetting() for point in found):
        found.insert(0, Point("policy", OWN, KnobSetting()))
    return found


def places(options: TradeOptions) -> list[Where]:
    """Every input at every repetition."""
    return [
        Where(
            name,
            "" if name in INPUTS or "." not in name else options.camera_path,
            repetition,
            phase_of(name, repetition, options.repetitions),
        )
        for repetition, name in itertools.product(range(options.repetitions), options.inputs)
    ]


def scale_of(options: TradeOptions) -> Scale:
    """Sizes of the runs."""
    return dataclasses.replace(SCALES[options.scale], seconds=options.seconds)


def runs(options: TradeOptions, points: Iterable[Point]) -> tuple[list[Run], dict[str, str]]:
    """Every point under all conditions.

    Returns:
        The runs; and the reasons why settings do not fit the scale, by the setting in words.

    Raises:
        ConfigError: the default does not fit.
    """
    scale, found, dropped = scale_of(options), list[Run](), dict[str, str]()
    middle, half = 0.5 * scale.seconds, 0.5 * min(options.jod_s, scale.seconds)
    base = Case(
        input=INPUTS[0],
        policy=OWN,
        tsar=scale.config(ROW, TsarConfig()),
        scale=scale,
        ledger=options.ledger,
        trace_segments=options.trace_segments,
        jod_span_s=(middle - half, middle + half) if options.jod_s else None,
        display=options.display,
        stills_s=(middle,),
    )
    for point, where in itertools.product(points, places(options)):
        try:
            found.append(Run(point, where, fitting(case_of(point.setting, where, scale, base))))
        except ConfigError as error:
            if point.setting == KnobSetting():
                raise
            dropped[point.setting.words] = str(error)
    return found, dropped
