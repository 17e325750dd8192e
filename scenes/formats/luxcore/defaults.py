"""Properties of LuxCore that mean nothing for a converted scene: hints to the renderer, and values that are defaults.

Source: LuxCore SDK reference manual (wiki of LuxCoreRender); defaults as LuxCore 2.10 prints them (``ToProperties``).
"""

from __future__ import annotations

import re

import numpy as np

from scenes.formats.losses import LossReport
from scenes.formats.luxcore.syntax import Block, Property

_HINTS = re.compile(
    r"(?:emission\.)?(?:id|importance|samples|directlightsampling\.type)|photongi\.enable|storage|resizepolicy\..*"
    r"|autovolume\.enable|visibilitymapcache\..*|distribution\.(?:width|height)|priority|lightid|bakemap\..*"
)
"""Properties that affect how LuxCore computes its picture, but not the picture."""

_DEFAULTS = {
    "emission.theta": "90", "emission.temperature": "-1", "temperature": "-1", "normalizebycolor": "1",
    "emission.normalizebycolor": "1", "temperature.normalize": "0", "emission.temperature.normalize": "0",
    "visibility.indirect.diffuse.enable": "1", "visibility.indirect.glossy.enable": "1",
    "visibility.indirect.specular.enable": "1", "shadowcatcher.enable": "0", "shadowcatcher.onlyinfinitelights": "0",
    "holdout.enable": "0", "camerainvisible": "0", "transparency.shadow": "0 0 0", "bumpsamplingdistance": "0.001",
    "doublesided": "0", "relsize": "1", "groundalbedo": "0 0 0", "ground.enable": "0", "ground.autoscale": "1",
    "ground.color": "0.75 0.75 0.75", "sampleupperhemisphereonly": "0", "shift": "0 0", "mapping.rotation": "0",
    "mapping.uvindex": "0", "randomizedtiling.enable": "0", "channel": "default", "normalize": "0",
    "mapping.type": "uvmapping2d", "cauchyb": "0", "cauchyc": "0", "filmthickness": "0", "filmior": "1.5",
    "autofocus.enable": "0", "clippingplane.enable": "0", "bokeh.blades": "0", "bokeh.power": "3",
    "bokeh.distribution.type": "NONE", "oculusrift.barrelpostpro.enable": "0", "hither": "0.001", "yon": "1e30",
    "cliphither": "0.001", "clipyon": "1e30", "index": "0 0 0", "flipz": "0",
}  # fmt: skip
"""Values with which a property changes nothing."""


def drop_meaningless(block: Block, report: LossReport) -> None:
    """Takes properties that mean nothing out of a block; hints are reported as such."""
    for rest, found in list(block.items()):
        if _HINTS.fullmatch(rest):
            report.hint(str(found.place), f"property {found.key!r}")
        elif rest not in _DEFAULTS or not _same(found, _DEFAULTS[rest]):
            continue
        del block[rest]


def _same(found: Property, default: str) -> bool:
    if found.text in ("true", "false"):
        return default == str(int(found.text == "true"))
    if not found.is_number:
        return found.text.strip("\"'") == default
    try:
        wanted = np.array([float(word) for word in default.split()])
    except ValueError:
        return False
    values = found.numbers()
    return len(values) in (1, len(wanted)) and bool(np.allclose(values, wanted, rtol=1e-6, atol=0.0))
