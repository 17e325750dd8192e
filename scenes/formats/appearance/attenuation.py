"""Absorbing media by the colour that is left of white light after a distance, as glTF gives them.

Source: Khronos Group, extension KHR_materials_volume of glTF 2.0, sections "Attenuation" and "Properties".
"""

from __future__ import annotations

import math

import numpy as np

from scenes.arithmetic import exp, log
from scenes.canonical import Medium, Rgb
from scenes.formats.appearance.spectra import rgb

LEAST = 1e-8
"""Least share of the light that is left after the distance; the format allows none, for which no coefficient stands."""


def attenuation(medium: Medium) -> dict[str, object]:
    """The properties of a medium that absorbs: the distance, in scene units, after which a share of 1/e of the light is
    left of the colour that is absorbed most, and the colour there."""
    most = max(medium.absorption)
    if most == 0.0:
        return {}
    color = exp(-np.array(medium.absorption) / most)
    return {"attenuationDistance": 1.0 / most, "attenuationColor": [float(part) for part in color]}


def medium_of(color: Rgb, distance: float) -> Medium | None:
    """The medium by the colour in [0, 1] that is left of white light after a distance in scene units, ``-ln c / d``;
    None for one that absorbs nothing."""
    if not 0.0 < distance < math.inf or min(color) >= 1.0:
        return None
    return Medium(rgb(-log(np.clip(color, LEAST, 1.0)) / distance))
