"""Results of a sensitivity study that are made up."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pandas as pd

from analysis.sensitivity.options import SensitivityOptions
from analysis.sensitivity.runs import TemplateSetting, runs
from analysis.sensitivity.tables import TablesByPlace

TWO = SensitivityOptions(inputs=("chase", "fast-crossing"))
Errors = Callable[[str, TemplateSetting | None, int], float]


def made_up(options: SensitivityOptions, error: Errors) -> TablesByPlace:
    """Results whose error rises and falls about ``error``, as the framed one does; NaN is a run that failed."""
    shape = np.array([0.5, 1.0, 1.5])
    found = {run.place: error(*run.place) for run in runs(options)}
    return {place: pd.DataFrame({"mse": shape * mean}) for place, mean in found.items() if not math.isnan(mean)}


def centred(name: str, setting: TemplateSetting | None, repetition: int) -> float:
    """The framed renderer has 2; the least error lies at slopes (-2, 0), bias 1 and the default offsets."""
    if setting is None:
        return 2.0
    away = (setting.spatial_slope + 2) ** 2 + setting.temporal_slope**2 + (setting.bias - 1) ** 2
    offsets = (setting.spatial_offset + 7) ** 2 + (setting.temporal_offset + 9) ** 2
    return (1.0 if name == "chase" else 3.0) * float(np.exp(0.1 * away + 0.01 * offsets))
