"""Lights of LuxCore as those of LuxRender 1.x.

Source: LuxCore SDK reference manual (wiki of LuxCoreRender), section on lights; defaults of LuxCore 2.10.
"""

from __future__ import annotations

import numpy as np

from scenes.formats.directives.syntax import Values
from scenes.formats.losses import LossReport
from scenes.formats.luxcore.directives import numbers, parameters
from scenes.formats.luxcore.syntax import Block

_KINDS = {"sharpdistant": "distant", "constantinfinite": "infinite", "mappoint": "goniometric"}
_NAMES = {"position": "from", "target": "to", "dir": "sundir", "file": "mapname"}
_DAYLIGHT = ("sun", "sky", "sky2")


def light_values(kind: str, block: Block, report: LossReport) -> tuple[str, list[Values]]:
    """Kind and parameters of a light in LuxRender; used properties are taken out of ``block``."""
    gain = np.broadcast_to(block.pop("gain").numbers(1, 3), 3) if "gain" in block else np.ones(3)
    where = str(next(iter(block.values())).place) if block else f"light {kind!r}"
    values: list[Values] = []
    for rest in ("power", "efficency", "efficiency"):
        if rest in block and not block[rest].numbers(1)[0]:
            del block[rest]
    if "efficency" in block and "power" not in block:
        del block["efficency"]
    if kind in _DAYLIGHT:
        if gain.min() != gain.max():
            report.add(where, f"a gain of each colour of the light {kind!r}", "their mean")
        values += numbers("gain", float(gain.mean()))
        values += [] if "turbidity" in block else numbers("turbidity", 2.2)
    else:
        color = np.broadcast_to(block.pop("color").numbers(1, 3), 3) if "color" in block else np.ones(3)
        values += numbers("L", *(color * gain).tolist())
    if kind in ("distant", "sharpdistant"):
        toward = block.pop("direction").numbers(3).tolist() if "direction" in block else (0.0, 0.0, 1.0)
        values += [*numbers("from", 0.0, 0.0, 0.0), *numbers("to", *toward)]
        if kind == "distant":
            values += [] if "theta" in block else numbers("theta", 10.0)
    if "colorspace" in block:
        report.add(str(block["colorspace"].place), f"property {block.pop('colorspace').key!r}", "its gamma")
    return _KINDS.get(kind, kind), values + parameters(block, (), _NAMES)
