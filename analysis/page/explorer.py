"""The explorer of a page: points in a plot of two chosen quantities, each with its setting and its picture.

The page contains all points as one block of JSON, which the script of the page (``explorer_page.js``) draws in its
template. Hovering over a point shows its setting, and a click shows its picture.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.page.comparer import source

SCRIPT = Path(__file__).with_name("explorer_page.js")

SHAPES = (
    "M0-6L5.6 4.4H-5.6Z",
    "M-5 0a5 5 0 1 0 10 0a5 5 0 1 0-10 0Z",
    "M-4.5-4.5H4.5V4.5H-4.5Z",
    "M0-6.2L6.2 0L0 6.2L-6.2 0Z",
)
"""Marks of the kinds in turn, as paths of SVG about their middle: kinds can be told apart in grey, too."""

STYLE = """
.explorer{display:grid;grid-template-columns:minmax(0,1fr) 280px;gap:16px} .explorer select{font:inherit;max-width:100%}
.explorer .choices{grid-column:1/-1;display:flex;flex-wrap:wrap;gap:.3em 1.2em} .explorer svg{width:100%;height:auto;
font-size:12px;display:block} .explorer svg text{fill:var(--soft)} .explorer .grid{stroke:var(--line)}
.explorer .front{fill:none;stroke:var(--ink);stroke-width:1.4}
.explorer .dot{cursor:pointer;stroke:var(--paper);stroke-width:.7}
.explorer .dot:focus{outline:none;stroke:var(--ink);stroke-width:2}
.explorer .picked{stroke:var(--ink);stroke-width:2}
.explorer .beside img{width:100%;image-rendering:pixelated;display:block;background:#181818;margin:.3em 0}
.explorer .beside{font-size:13px} .explorer .legend span{margin-right:1em;white-space:nowrap}
.explorer .legend svg{display:inline;width:1em;height:1em;margin-right:.3em;vertical-align:-.1em}
@media(max-width:760px){.explorer{grid-template-columns:minmax(0,1fr)}}
"""


@dataclass(frozen=True)
class PlotPoint:
    """A point of the plot.

    Attributes:
        group: name of the points that are shown together.
        kind: name that decides its colour.
        title: its setting.
        values: quantities by name; those that are not finite, or not positive on a logarithmic axis, are not drawn.
        picture: name of its picture; empty for none.
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
        across, upward: quantities that either axis may show, with the one shown at first in front.
        colours: colours by kind; marks follow their order.
        pictures: PNG or WebP files by name.
        truths: names of the pictures with which groups are compared, by group.
        note: text below the plot.
    """

    points: Sequence[PlotPoint]
    across: Sequence[str]
    upward: Sequence[str]
    colours: Mapping[str, str]
    pictures: Mapping[str, bytes]
    truths: Mapping[str, str]
    note: str = ""

    def __post_init__(self) -> None:
        if not self.points:
            raise ValueError("explorer: expected at least one point, got none")


def shown(explorer: Explorer) -> dict[str, Any]:
    """The data for the template of the page."""
    shapes = {kind: SHAPES[number % len(SHAPES)] for number, kind in enumerate(explorer.colours)}
    given = {
        "shapes": shapes,
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
    return {
        "explorer_given": given,
        "explorer_shapes": shapes,
        "explorer_groups": list(dict.fromkeys(point.group for point in explorer.points)),
        "explorer_kinds": list(dict.fromkeys(point.kind for point in explorer.points)),
    }
