"""Curves of a page over time: their values, and their layout in a plot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.page.figures import dashes_of, ink_of, spread

# size of a plot in units of its view box
WIDTH = 560.0
LEFT, TOP = 62.0, 14.0
_LINE, _LETTER = 19.0, 9.2  # of text
_LEAD = 34.0  # between a line's end and its label
_LETTERS_MOST = 28
_BELOW = 26.0


@dataclass(frozen=True)
class Curve:
    """Values over time; on a logarithmic axis values that are not positive and finite leave gaps.

    Attributes:
        label: text at the end of the curve.
        times_s, values: times in seconds and values, of equal length.
        style: number of its ink and dashes; 0 is the style of the run's own policy.
    """

    label: str
    times_s: Sequence[float]
    values: Sequence[float]
    style: int

    def __post_init__(self) -> None:
        if len(self.times_s) != len(self.values):
            raise ValueError(f"curve {self.label}: expected {len(self.times_s)} values, got {len(self.values)}")


@dataclass(frozen=True)
class Plot:
    """Curves of one quantity.

    Attributes:
        title: text above the plot, at most a sentence.
        unit: unit of the values; empty for none.
        curves: at least one.
        logarithmic: whether the axis of the values is logarithmic.
        level: value marked by a line; None for none.
        marks_s: marked times, seconds.
    """

    title: str
    unit: str
    curves: Sequence[Curve]
    logarithmic: bool = True
    level: float | None = None
    marks_s: Sequence[float] = ()

    def __post_init__(self) -> None:
        if not self.curves:
            raise ValueError(f"plot {self.title}: expected at least one curve, got none")


@dataclass(frozen=True)
class Label:
    """Text and its position."""

    text: str
    x: float
    y: float


@dataclass(frozen=True)
class Line:
    """A curve as an SVG path, its label, and its end point; NaN if it has no point."""

    path: str
    label: Label
    end_y: float
    style: int
    dashes: str


@dataclass(frozen=True)
class Drawing:
    """The layout of a plot, in units of its view box."""

    width: float
    height: float
    left: float
    right: float
    top: float
    bottom: float
    across: list[Label]
    upward: list[Label]
    lines: list[Line]
    marks: list[float]
    level: float | None


def letters_of(plots: Sequence[Plot]) -> int:
    """Number of letters of the longest label, for plots with aligned time axes."""
    return min(max((len(curve.label) for plot in plots for curve in plot.curves), default=0), _LETTERS_MOST)


def drawing(plot: Plot, span_s: tuple[float, float], letters: int = 0) -> Drawing:
    """Lays out a plot over a span of time, with room for labels of ``letters`` letters, by default those of its own
    labels."""
    height = max(230.0, _LINE * len(plot.curves) + TOP + _BELOW)
    axis = _Axis.of(plot, span_s, WIDTH - _LEAD - _LETTER * (letters or letters_of([plot])), height - _BELOW)
    lines = [_line(curve, axis) for curve in plot.curves]
    places = spread([line.end_y for line in lines], _LINE, TOP, axis.bottom)
    for number, y in enumerate(places):
        one = lines[number]
        lines[number] = Line(
            one.path, Label(_shortened(one.label.text), axis.right + _LEAD - 6, y), one.end_y, one.style, one.dashes
        )
    return Drawing(
        width=WIDTH,
        height=height,
        left=LEFT,
        right=axis.right,
        top=TOP,
        bottom=axis.bottom,
        across=[Label(f"{t:g}", round(axis.x(t), 1), axis.bottom + 18) for t in axis.times()],
        upward=[Label(f"{v:g}", LEFT - 7, round(axis.y(v), 1)) for v in axis.values()],
        lines=lines,
        marks=[round(axis.x(t), 1) for t in plot.marks_s if span_s[0] <= t <= span_s[1]],
        level=None if plot.level is None else round(axis.y(plot.level), 1),
    )


def _shortened(text: str) -> str:
    return text if len(text) <= _LETTERS_MOST else f"{text[: _LETTERS_MOST - 1]}…"


@dataclass(frozen=True)
class _Axis:
    """Maps time and value to positions in the plot."""

    start_s: float
    end_s: float
    low: float
    high: float
    logarithmic: bool
    right: float
    bottom: float

    @classmethod
    def of(cls, plot: Plot, span_s: tuple[float, float], right: float, bottom: float) -> _Axis:
        start_s, end_s = span_s
        end_s = end_s if end_s > start_s else start_s + 1.0
        inside = [
            float(v)
            for curve in plot.curves
            for t, v in zip(curve.times_s, curve.values, strict=True)
            if start_s <= t <= end_s and math.isfinite(v) and (v > 0.0 or not plot.logarithmic)
        ]
        values = [*inside, *([plot.level] if plot.level is not None else [])] or [0.1, 1.0]
        if plot.logarithmic:
            low, high = math.log10(min(values)), math.log10(max(values))
            margin = max(0.06 * (high - low), 0.05)
            return cls(start_s, end_s, low - margin, high + margin, True, right, bottom)
        low, high = min(0.0, *values), max(values)
        return cls(start_s, end_s, low, high + (0.06 * (high - low) or 1.0), False, right, bottom)

    def x(self, time_s: float) -> float:
        return LEFT + (time_s - self.start_s) / (self.end_s - self.start_s) * (self.right - LEFT)

    def y(self, value: float) -> float:
        scaled = math.log10(value) if self.logarithmic else value
        return self.bottom - (scaled - self.low) / (self.high - self.low) * (self.bottom - TOP)

    def values(self) -> list[float]:
        """Values to label: 1, 2 and 5 times every power of ten, or the powers of ten alone if there are many."""
        if not self.logarithmic:
            return _round_steps(self.low, self.high, 5)
        steps = (1.0, 2.0, 5.0) if self.high - self.low < 2.0 else (1.0,)
        decades = range(math.floor(self.low), math.ceil(self.high) + 1)
        return [s * 10.0**d for d in decades for s in steps if self.low <= math.log10(s * 10.0**d) <= self.high]

    def times(self) -> list[float]:
        return _round_steps(self.start_s, self.end_s, 6)


def _round_steps(low: float, high: float, most: int) -> list[float]:
    """At most ``most`` round numbers from low to high."""
    step = 10.0 ** math.floor(math.log10((high - low) / most))
    step *= next(s for s in (1, 2, 5, 10, 20) if (high - low) / (s * step) <= most)
    numbers = np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
    return (numbers * step).tolist()


def _line(curve: Curve, axis: _Axis) -> Line:
    points, drawn, before = [], math.nan, False
    for time_s, value in zip(curve.times_s, curve.values, strict=True):
        here = axis.start_s <= time_s <= axis.end_s and math.isfinite(value) and (value > 0 or not axis.logarithmic)
        if here:
            drawn = axis.y(value)
            # a point starts a new segment if the one before it is missing
            points.append(f"{'L' if before else 'M'}{axis.x(time_s):.1f} {drawn:.1f}")
        before = here
    return Line("".join(points), Label(curve.label, 0, 0), drawn, ink_of(curve.style), dashes_of(curve.style))
