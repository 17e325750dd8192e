"""The comparer of a page: pictures at many times that are compared two at a time, and curves with a common cursor.

The page contains everything that changes from step to step: one block of JSON, and a block for each picture, with equal
pictures stored once. :func:`read_comparer` reads a page back, so that runs of different days can be compared.
"""

from __future__ import annotations

import base64
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from analysis.page.curves import Curve, Plot
from analysis.page.pictures import ColorScale, palette

SCRIPTS = tuple(
    Path(__file__).with_name(f"comparer_{name}.js") for name in ("errors", "pictures", "stage", "curves", "page")
)
ERROR_PALETTES = {"signed": "RdBu_r", "squared": "inferno", "flip": "magma"}
_VERSION = 1


@dataclass(frozen=True)
class Panel:
    """A picture that changes over time.

    Attributes:
        label: its unique name.
        truth: label of the reference for its errors; empty for references and maps.
        scale: scale of a map; None for pictures.
    """

    label: str
    truth: str = ""
    scale: ColorScale | None = None


@dataclass(frozen=True)
class Step:
    """Pictures at one time.

    Attributes:
        time_s: the time, seconds.
        pictures: image files by label, all of one size except maps; absent ones and None are shown as missing.
    """

    time_s: float
    pictures: Mapping[str, bytes | None]


@dataclass(frozen=True)
class Comparer:
    """Content of the comparer.

    Attributes:
        panels: in the order of their thumbnails, at least one.
        steps: at least one, in order of time.
        left, right: labels of the two panels that are compared at first.
        plots: curves below the pictures.
        note: one sentence on how pictures are stored.
    """

    panels: Sequence[Panel]
    steps: Sequence[Step]
    left: str
    right: str
    plots: Sequence[Plot] = ()
    note: str = ""

    def __post_init__(self) -> None:
        if not self.steps:
            raise ValueError("comparer: expected at least one step, got none")
        labels = [panel.label for panel in self.panels]
        for name in (self.left, self.right, *(panel.truth for panel in self.panels if panel.truth)):
            if name not in labels:
                raise ValueError(f"comparer: expected one of {', '.join(labels)}, got {name!r}")

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last time of the steps and of the first plot, seconds."""
        times = [step.time_s for step in self.steps]
        times += [float(t) for plot in self.plots[:1] for curve in plot.curves for t in curve.times_s]
        return min(times), max(times)

    def stored(self) -> tuple[dict[str, Any], list[bytes]]:
        """The JSON data for the scripts of the page, and the pictures that it numbers, each once."""
        numbers: dict[bytes, int] = {}
        steps = []
        for step in self.steps:
            files = [step.pictures.get(panel.label) for panel in self.panels]
            found = [None if one is None else numbers.setdefault(one, len(numbers)) for one in files]
            steps.append({"time": step.time_s, "pictures": found})
        used = {*ERROR_PALETTES.values(), *(panel.scale.palette for panel in self.panels if panel.scale)}
        given = {
            "version": _VERSION,
            "span": list(self.span_s),
            "left": self.left,
            "right": self.right,
            "note": self.note,
            "panels": [asdict(panel) for panel in self.panels],
            "steps": steps,
            "plots": [_plot(plot) for plot in self.plots],
            "errors": ERROR_PALETTES,
            "palettes": {name: base64.b64encode(palette(name).tobytes()).decode() for name in sorted(used)},
        }
        return given, list(numbers)


def _plot(plot: Plot) -> dict[str, Any]:
    curves = [
        {
            "label": curve.label,
            "style": curve.style,
            "times": [round(float(t), 8) for t in curve.times_s],
            "values": [float(f"{v:.5g}") if math.isfinite(v) else None for v in curve.values],
        }
        for curve in plot.curves
    ]
    return {
        "title": plot.title,
        "unit": plot.unit,
        "curves": curves,
        "logarithmic": plot.logarithmic,
        "level": plot.level,
        "marks": [round(float(t), 8) for t in plot.marks_s],
    }


def source(picture: bytes) -> str:
    """A picture as a data URL."""
    return f"data:image/{kind_of(picture)};base64,{base64.b64encode(picture).decode()}"


def kind_of(picture: bytes) -> str:
    """Kind of an image file: png, avif or webp."""
    return "png" if picture.startswith(b"\x89PNG") else "avif" if picture[4:8] == b"ftyp" else "webp"


def block(given: Any) -> str:
    """JSON for a block of a page, with "<" escaped: no other character could end the block."""
    return json.dumps(given, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


_DATA = re.compile(r"<script type='application/json' id='comparer-data'>(.*?)</script>", re.DOTALL)
_PICTURE = re.compile(r"<script type='text/plain' id='picture-(\d+)'>data:image/\w+;base64,([^<]*)</script>")


def read_comparer(path: Path) -> Comparer:
    """The comparer of a page that :func:`analysis.page.report.write_report` wrote.

    Raises:
        ValueError: the page has no comparer, or one of another version.
    """
    text = path.read_text(encoding="utf-8")
    found = _DATA.search(text)
    if found is None:
        raise ValueError(f"{path}: expected a page with pictures to compare, found none")
    given = json.loads(found[1])
    if given.get("version") != _VERSION:
        raise ValueError(f"{path}: expected pictures of version {_VERSION}, got {given.get('version')}")
    files = {int(number): base64.b64decode(data) for number, data in _PICTURE.findall(text)}
    panels = [
        Panel(one["label"], one["truth"], ColorScale(**_tuples(one["scale"])) if one["scale"] else None)
        for one in given["panels"]
    ]
    steps = [
        Step(
            one["time"],
            {p.label: None if n is None else files[n] for p, n in zip(panels, one["pictures"], strict=True)},
        )
        for one in given["steps"]
    ]
    plots = [
        Plot(one["title"], one["unit"], [_curve(curve) for curve in one["curves"]], one["logarithmic"], one["level"],
             one["marks"])
        for one in given["plots"]
    ]  # fmt: skip
    return Comparer(panels, steps, given["left"], given["right"], plots, given["note"])


def _curve(given: Mapping[str, Any]) -> Curve:
    values = [math.nan if value is None else value for value in given["values"]]
    return Curve(given["label"], given["times"], values, given["style"])


def _tuples(given: Mapping[str, Any]) -> dict[str, Any]:
    return {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}
