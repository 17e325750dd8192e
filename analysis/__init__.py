"""Measurement: cost model, quality, run records, figures, reports, and the wiring of experiments.

This module offers the Python interface. Each name is imported when it is first used.
"""

from typing import TYPE_CHECKING

from tsar.lazy import lazily

if TYPE_CHECKING:
    from analysis.comparison.compare import Result as Result, compare as compare
    from analysis.comparison.load import load as load
    from analysis.metrics import METRICS as METRICS, Metric as Metric

__getattr__, __dir__ = lazily(
    __name__,
    {
        "analysis.comparison.compare": "Result compare",
        "analysis.comparison.load": "load",
        "analysis.metrics": "METRICS Metric",
    },
)
