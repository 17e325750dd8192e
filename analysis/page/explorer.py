"""The explorer of a page: points in a plot of two quantities that are chosen, each with its setting and its picture.

All points are put into the page as one block of JSON, which the script of the page (``explorer_page.js``) draws. Where
a point is hovered over its setting is shown, and where it is clicked its picture.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from analysis.page.player import source

SCRIPT = Path(__file__).with_name("explorer_page.js")

STYLE = """
.explorer{display:grid;grid-template-columns:minmax(0,1fr) 280px;gap:16px} .explorer select{font:inherit;max-width:100%}
.explorer .choices{grid-column:1/-1;display:flex;flex-wrap:wrap;gap:.3em 1.2em} .explorer svg{width:100%;height:auto;
font-size:12px;display:block} .explorer svg text{fill:#555} .explorer .grid{stroke:#e6e6e6} .explorer .front{fill:none;
stroke:#222;stroke-width:1.4} .explorer circle{cursor:pointer;stroke:#fff;stroke-width:.7}
.explorer circle:focus{outline:none;stroke:#000;stroke-width:2} .explorer .picked{stroke:#000;stroke-width:2}
.explorer .beside img{width:100%;image-rendering:pixelated;display:block;background:#181818;margin:.3em 0}
.explorer .beside{font-size:13px} .explorer .legend span{margin-right:1em;white-space:nowrap}
.explorer .legend i{display:inline-block;width:.8em;height:.8em;border-radius:50%;margin-right:.3em}
@media(max-width:760px){.explorer{grid-template-columns:minmax(0,1fr)}}
"""


@dataclass(frozen=True)
class Point:
    """A point of the plot.

    Attributes:
        group: of points that are shown together.
        kind: what decides its colour.
        title: its setting.
        values: quantities by name; those that are not positive and finite are not drawn.
        picture: name of its picture; empty where there is none.
    """

    group: str
    kind: str
    title: str
    values: Mapping[str, float]
    picture: str = ""


@dataclass(frozen=True)
class Explorer:
    """Content of the explorer.

    Attributes:
        points: at least one.
        across, upward: quantities that either axis may show, the first to begin with.
        colours: of kinds.
        pictures: PNG or WebP by name.
        truths: names of the pictures that groups are compared with, by group.
        note: below the plot.
    """

    points: Sequence[Point]
    across: Sequence[str]
    upward: Sequence[str]
    colours: Mapping[str, str]
    pictures: Mapping[str, bytes]
    truths: Mapping[str, str]
    note: str = ""

    def __post_init__(self) -> None:
        if not self.points:
            raise ValueError("explorer: expected at least one point, got none")


def markup(explorer: Explorer) -> str:
    """An empty plot, the choices, and the data."""
    groups = list(dict.fromkeys(point.group for point in explorer.points))
    kinds = list(dict.fromkeys(point.kind for point in explorer.points))
    given = {
        "across": list(explorer.across),
        "upward": list(explorer.upward),
        "colours": dict(explorer.colours),
        "truths": dict(explorer.truths),
        "pictures": {name: source(picture) for name, picture in explorer.pictures.items()},
        "points": [
            {
                "group": point.group,
                "kind": point.kind,
                "title": point.title,
                "values": {name: float(v) if math.isfinite(v) else None for name, v in point.values.items()},
                "picture": point.picture,
            }
            for point in explorer.points
        ],
    }
    # "<" is the only character by which text could end the block
    block = json.dumps(given, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    legend = "".join(
        f"<span><i style='background:{escape(explorer.colours[kind], quote=True)}'></i>{escape(kind)}</span>"
        for kind in kinds
    )
    return (
        "<h2>Every point</h2><div class='explorer' id='explorer'><div class='choices'>"
        f"{_choice('group', 'input', groups)}{_choice('across', 'cost', explorer.across)}"
        f"{_choice('upward', 'error', explorer.upward)}</div>"
        "<div><noscript><p class='note'>Without JavaScript there is no plot here.</p></noscript>"
        f"<svg viewBox='0 0 720 460' role='group' aria-label='points'></svg><p class='legend'>{legend}</p>"
        f"<p class='note'>{escape(explorer.note)}</p></div>"
        "<div class='beside' aria-live='polite'><b class='title'>Hover a point: its setting; click it: its picture.</b>"
        "<table></table><div class='pictures'></div></div>"
        f"<script type='application/json' id='explorer-data'>{block}</script></div>"
    )


def _choice(name: str, label: str, values: Sequence[str]) -> str:
    options = "".join(f"<option>{escape(value)}</option>" for value in values)
    return f"<label>{escape(label)} <select name='{name}'>{options}</select></label>"
