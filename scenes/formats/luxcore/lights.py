"""Lights of LuxCore as those of LuxRender 1.x.

Source: LuxCore SDK reference manual (wiki of LuxCoreRender), section on lights; defaults of LuxCore 2.10.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import cos, product
from scenes.formats.directives.syntax import Values
from scenes.formats.losses import LossReport
from scenes.formats.luxcore.directives import numbers, parameters
from scenes.formats.luxcore.syntax import Block, Property
from scenes.formats.luxrender.read import LUMINANCE

_KINDS = {"sharpdistant": "distant", "constantinfinite": "infinite", "mappoint": "goniometric"}
_NAMES = {"position": "from", "target": "to", "dir": "sundir", "file": "mapname"}
_DAYLIGHT = ("sun", "sky", "sky2")


def light_values(kind: str, block: Block, report: LossReport) -> tuple[str, list[Values]]:
    """Kind and parameters of a light in LuxRender; used properties are taken out of ``block``."""
    gain = np.broadcast_to(block.pop("gain").numbers(1, 3), 3) if "gain" in block else np.ones(3)
    where = str(next(iter(block.values())).place) if block else f"light {kind!r}"
    values: list[Values] = []
    if kind in _DAYLIGHT:
        if gain.min() != gain.max():
            report.add(where, f"a gain of each colour of the light {kind!r}", "their mean")
        values += numbers("gain", float(gain.mean()))
        values += [] if "turbidity" in block else numbers("turbidity", 2.2)
    else:
        color = np.broadcast_to(block.pop("color").numbers(1, 3), 3) if "color" in block else np.ones(3)
        lumens = lumens_of(block, "") if kind in ("point", "spot") else 0.0
        if lumens > 0.0:
            gain = gain * lumens / _spread_sr(kind, block) / color_unit(block.pop("normalizebycolor", None), color)
        values += numbers("L", *(color * gain).tolist())
    if kind in ("distant", "sharpdistant"):
        toward = block.pop("direction").numbers(3).tolist() if "direction" in block else (0.0, 0.0, 1.0)
        values += [*numbers("from", 0.0, 0.0, 0.0), *numbers("to", *toward)]
        if kind == "distant":
            values += [] if "theta" in block else numbers("theta", 10.0)
    if "colorspace" in block:
        report.add(str(block["colorspace"].place), f"property {block.pop('colorspace').key!r}", "its gamma")
    return _KINDS.get(kind, kind), values + parameters(block, (), _NAMES)


def lumens_of(block: Block, prefix: str) -> float:
    """The power of a light or lamp times its efficacy, 0 if it is not given by its power."""
    lumens = [float(block.pop(f"{prefix}{rest}").numbers(1)[0]) if f"{prefix}{rest}" in block else 0.0
              for rest in ("power", "efficency", "efficiency")]  # fmt: skip
    return lumens[0] * (lumens[1] or lumens[2])


def color_unit(normalized: Property | None, color: NDArray[np.float64]) -> float:
    """What divides the power of a light: the luminance of its colour, or 1 if that does not count."""
    if normalized is not None and normalized.word() in ("0", "false"):
        return 1.0
    return float(product(LUMINANCE, color)) or 1.0


def _spread_sr(kind: str, block: Block) -> float:
    """The solid angle in which a light sends its power, in units of that of its gain (measured with LuxCore 2.10)."""
    if kind == "point":
        return 1.0
    outer, delta = (
        float(block[rest].numbers(1)[0]) if rest in block else default
        for rest, default in (("coneangle", 30.0), ("conedeltaangle", 5.0))
    )
    ends = cos(math.radians(outer - delta)) + cos(math.radians(outer))
    return max(2.0 * math.pi * (1.0 - 0.5 * ends), 1e-9)
