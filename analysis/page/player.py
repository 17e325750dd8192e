"""The player of a page: pictures of many times behind one slider, and curves with a cursor.

Everything that changes from step to step is computed here and put into the page as one block of JSON, which the script
of the page (``report_page.js``) shows.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SCRIPT = Path(__file__).with_name("report_page.js")

STYLE = """
.views{display:grid;grid-template-columns:repeat(4,minmax(0,1fr));gap:12px;margin:1em 0 .6em}
.views figure{margin:0;min-width:0} .views figcaption{font-size:13px;white-space:nowrap;overflow:hidden;
text-overflow:ellipsis} .frame img{width:100%;height:auto;display:block;background:#181818}
.gap{display:none;aspect-ratio:1;place-content:center;text-align:center;background:#f1efec;color:#777;font-size:13px;
border:1px dashed #b5b0a8;box-sizing:border-box;overflow:hidden} .gap b{color:#a33;font-size:15px}
.lost img{display:none} .lost .gap{display:grid} .now{font-size:13px;align-self:center;justify-self:center}
.now table{margin:0} .now td{padding-right:.6em} .now td.n{white-space:nowrap}
.swatch{display:inline-block;width:.8em;height:.8em;margin-right:.4em}
.controls{position:sticky;bottom:0;background:#fff;padding:.5em 0 .2em;font-variant-numeric:tabular-nums}
.controls button{font:inherit;width:4.5em;padding:.1em 0} .controls b,.controls span{margin-left:.8em}
#slider{display:block;margin:.5em 0 0 calc(6% - 8px);width:calc(92% + 16px);accent-color:#555}
#plot{display:block;width:100%;height:auto;cursor:crosshair;touch-action:pan-y;font-size:12px}
#plot text{fill:#555} .curve{fill:none;stroke-width:1.8;stroke-linejoin:round} .grid{stroke:#e2e2e2}
.mark{stroke:#aaa;stroke-dasharray:1 3} #cursor line{stroke:#222} #cursor circle{stroke:#fff}
@media(max-width:760px){.views{grid-template-columns:repeat(2,minmax(0,1fr))} #plot{font-size:19px}}
"""

# the plot in units of its view box; the slider above it has the same margins, in percent
_WIDTH, _HEIGHT = 1060.0, 230.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 0.06 * _WIDTH, 0.98 * _WIDTH, 8.0, 200.0


@dataclass(frozen=True)
class Step:
    """What the page shows at one position of the slider.

    Attributes:
        number: index into the times of the player.
        pictures: PNG or WebP by label; None where there is none, which the page says.
    """

    number: int
    pictures: Mapping[str, bytes | None]


@dataclass(frozen=True)
class Curve:
    """A value at every time of a player, on a logarithmic axis; values that are not positive and finite leave gaps."""

    label: str
    colour: str
    values: Sequence[float]


@dataclass(frozen=True)
class Player:
    """Content of the player.

    Attributes:
        times_s: times of the curves.
        steps: positions of the slider, at least one, in order of time; all show the labels of the first.
        curves: of one quantity.
        quantity: what the curves are of.
        marks_s: times that are marked by vertical lines.
        readings: more text by label, at every time, printed beside the values of the curves.
        note: below the curves.
    """

    times_s: Floats
    steps: Sequence[Step]
    curves: Sequence[Curve] = ()
    quantity: str = ""
    marks_s: Sequence[float] = ()
    readings: Mapping[str, Sequence[str]] = field(default_factory=dict)
    note: str = ""

    def __post_init__(self) -> None:
        if not self.steps:
            raise ValueError("player: expected at least one step, got none")
        series = {curve.label: curve.values for curve in self.curves} | dict(self.readings)
        for label, values in series.items():
            if len(values) != len(self.times_s):
                raise ValueError(f"player: {label}: expected {len(self.times_s)} values, got {len(values)}")

    @property
    def labels(self) -> list[str]:
        """Of the views."""
        return list(self.steps[0].pictures)


def source(picture: bytes) -> str:
    """A picture as an address that holds it."""
    kind = "png" if picture.startswith(b"\x89PNG") else "webp"
    return f"data:image/{kind};base64,{base64.b64encode(picture).decode()}"


def markup(player: Player) -> str:
    """Views at the first step, controls and curves; the data of the other steps follow as JSON."""
    given = data(player)
    first, last = given["steps"][0], len(player.steps) - 1
    pictures = zip(player.labels, first["pictures"], strict=True)
    views = "".join(_view(label, src, first["time"]) for label, src in pictures)
    # "<" is the only character by which text could end the block
    block = json.dumps(given, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return (
        f"<h2>Over time</h2><div id='player'><div class='views'>{views}{_now(player, first)}</div>"
        "<noscript><p class='note'>Without JavaScript only the first step is shown.</p></noscript>"
        f"<div class='controls' hidden><button type='button'>play</button><b id='time'>{first['time']}</b>"
        "<span class='note' id='count'></span><input id='slider' type='range' min='0' "
        f"max='{last}' step='1' value='0' autocomplete='off' aria-label='time'></div>"
        f"{_plot(player, first)}<p class='note'>{escape(player.note)}</p></div>"
        f"<script type='application/json' id='player-data'>{block}</script>"
    )


def data(player: Player) -> dict[str, Any]:
    """What the script of the page is given: all that changes, ready to be shown."""
    axis = _Axis.of(player)
    return {"labels": player.labels, "steps": [_step(player, axis, step) for step in player.steps]}


def _step(player: Player, axis: _Axis, step: Step) -> dict[str, Any]:
    time_s = float(player.times_s[step.number])
    values = [float(curve.values[step.number]) for curve in player.curves]
    pictures = (step.pictures.get(label) for label in player.labels)
    return {
        "time": f"{time_s:.3f} s",
        "x": round(float(axis.x(time_s)), 2),
        "y": [round(float(axis.y(value)), 2) if _drawable(value) else None for value in values],
        "values": [f"{value:.2e}" for value in values] + [texts[step.number] for texts in player.readings.values()],
        "pictures": [None if picture is None else source(picture) for picture in pictures],
    }


def _view(label: str, src: str | None, time: str) -> str:
    name = escape(label, quote=True)
    image = f"<img alt='{name} at {time}' src='{src}'>" if src else ""
    gap = f"<div class='gap'><b>missing</b><span>{name}</span><span>{time}</span></div>"
    lost = "" if src else " lost"
    return f"<figure><figcaption>{name}</figcaption><div class='frame{lost}'>{image}{gap}</div></figure>"


def _now(player: Player, first: Mapping[str, Any]) -> str:
    """The values at the cursor, which is the legend of the curves too."""
    inks = [curve.colour for curve in player.curves] + [""] * len(player.readings)
    names = [curve.label for curve in player.curves] + list(player.readings)
    rows = "".join(
        f"<tr><td>{_swatch(ink)}{escape(name)}</td><td class='n'>{escape(value)}</td></tr>"
        for ink, name, value in zip(inks, names, first["values"], strict=True)
    )
    return f"<div class='now'><b>{escape(player.quantity)}</b><table>{rows}</table></div>" if rows else ""


def _swatch(ink: str) -> str:
    return f"<span class='swatch' style='background:{escape(ink, quote=True)}'></span>" if ink else ""


@dataclass(frozen=True)
class _Axis:
    """From time and value to places in the plot."""

    start_s: float
    end_s: float
    low: float
    high: float

    @classmethod
    def of(cls, player: Player) -> _Axis:
        values = [float(v) for curve in player.curves for v in curve.values if _drawable(v)] or [0.1, 1.0]
        start_s, end_s = float(player.times_s[0]), float(player.times_s[-1])
        low, high = math.log10(min(values)), math.log10(max(values))
        margin = max(0.08 * (high - low), 0.05)
        return cls(start_s, end_s if end_s > start_s else start_s + 1.0, low - margin, high + margin)

    def x(self, time_s: float | Floats) -> Any:
        return _LEFT + (time_s - self.start_s) / (self.end_s - self.start_s) * (_RIGHT - _LEFT)

    def y(self, value: float | Floats) -> Any:
        return _BOTTOM - (np.log10(value) - self.low) / (self.high - self.low) * (_BOTTOM - _TOP)

    def values(self) -> list[float]:
        """Values to label: 1, 2 and 5 of every decade, or the decades where they are many."""
        steps = (1.0, 2.0, 5.0) if self.high - self.low < 2.5 else (1.0,)
        decades = range(math.floor(self.low), math.ceil(self.high) + 1)
        return [s * 10.0**d for d in decades for s in steps if self.low <= math.log10(s * 10.0**d) <= self.high]

    def times(self) -> list[float]:
        """About eight round times to label."""
        step = 10.0 ** math.floor(math.log10((self.end_s - self.start_s) / 4))
        step *= next(s for s in (1, 2, 5, 10) if (self.end_s - self.start_s) / (s * step) <= 10)
        numbers = np.arange(math.ceil(self.start_s / step - 1e-9), math.floor(self.end_s / step + 1e-9) + 1)
        return (numbers * step).tolist()


def _drawable(value: float) -> bool:
    return 0.0 < value < math.inf


def _plot(player: Player, first: Mapping[str, Any]) -> str:
    axis, parts = _Axis.of(player), []
    for value in axis.values():
        y = f"{axis.y(value):.1f}"
        parts.append(f"<line class='grid' x1='{_LEFT:g}' x2='{_RIGHT:g}' y1='{y}' y2='{y}'></line>")
        parts.append(f"<text x='{_LEFT - 6:g}' y='{y}' text-anchor='end' dy='.35em'>{value:g}</text>")
    for time_s in axis.times():
        anchor = f"x='{axis.x(time_s):.1f}' y='{_BOTTOM + 4:g}' text-anchor='middle' dy='1em'"
        parts.append(f"<text {anchor}>{time_s:g} s</text>")
    for time_s in player.marks_s:
        if axis.start_s <= time_s <= axis.end_s:
            x = f"{axis.x(time_s):.1f}"
            parts.append(f"<line class='mark' x1='{x}' x2='{x}' y1='{_TOP:g}' y2='{_BOTTOM:g}'></line>")
    parts += [_line(player.times_s, curve, axis) for curve in player.curves]
    dots = "".join(_dot(curve, y) for curve, y in zip(player.curves, first["y"], strict=True))
    cursor = f"<line x1='0' x2='0' y1='{_TOP:g}' y2='{_BOTTOM:g}'></line>{dots}"
    parts.append(f"<g id='cursor' transform='translate({first['x']} 0)'>{cursor}</g>")
    label = escape(player.quantity, quote=True)
    return f"<svg id='plot' viewBox='0 0 {_WIDTH:g} {_HEIGHT:g}' role='img' aria-label='{label}'>{''.join(parts)}</svg>"


def _line(times_s: Floats, curve: Curve, axis: _Axis) -> str:
    values = np.asarray(curve.values, np.float64)
    drawn = np.isfinite(values) & (values > 0)
    x, y = axis.x(times_s), axis.y(np.where(drawn, values, 1.0))
    # a point starts a new piece of line where the one before it is missing
    moves = np.where(np.append(False, drawn[:-1]), "L", "M")
    path = "".join(f"{moves[i]}{x[i]:.1f} {y[i]:.1f}" for i in drawn.nonzero()[0])
    return f"<path class='curve' stroke='{escape(curve.colour, quote=True)}' d='{path}'></path>"


def _dot(curve: Curve, y: float | None) -> str:
    place = f"cy='{y}'" if y is not None else "cy='0' visibility='hidden'"
    return f"<circle cx='0' r='4.5' {place} fill='{escape(curve.colour, quote=True)}'></circle>"
