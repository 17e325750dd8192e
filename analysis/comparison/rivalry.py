"""A run beside the best of its rivals, moment by moment and by every metric."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from analysis.command.console import Table
from analysis.comparison.summary import Measured, metrics_of
from analysis.metrics import METRICS
from analysis.metrics.quality import Floats, ratio_statistics
from analysis.metrics.rivals import BEST, Standing, best_of, best_shares, standing


def best_rival(measured: Measured) -> dict[str, Any]:
    """What ``summary.json`` says of the best rival; empty where there are fewer than two."""
    if len(measured.rivals) < 2:
        return {}
    errors = {name: measured.mse[name] for name in measured.rivals}
    best = best_of(errors.values())
    return {
        BEST.replace("-", "_"): {
            "mse": best,
            "ratio_statistics": ratio_statistics(measured.mse[measured.own], best),
            "share_of_rivals": best_shares(errors),
            "metrics": {metric: dataclasses.asdict(found) for metric, _, _, found in _standings(measured)},
        }
    }


def best_rival_table(measured: Measured) -> Table | None:
    """The run beside the best rival by every metric; None where there are fewer than two rivals."""
    if len(measured.rivals) < 2:
        return None
    rows = [
        (metric, f"{np.median(own):.4g}", f"{np.median(best):.4g}", f"{100 * found.share:.1f} %", f"{found.ratio:.3f}")
        for metric, own, best, found in _standings(measured)
    ]
    shares = best_shares({name: measured.mse[name] for name in measured.rivals})
    leading = ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares.items())
    note = f"The best rival is the best of {', '.join(measured.rivals)} at each moment. By MSE it is {leading}."
    header = ("metric", f"median, {measured.own}", f"median, {BEST}", "moments at least as good", "ratio of medians")
    return Table("Beside the best rival", header, rows, note)


def _standings(measured: Measured) -> Iterator[tuple[str, Floats, Floats, Standing]]:
    """Metric, values of the run and of the best rival where they were measured, and the standing."""
    for metric in ("mse", "log_mse", *(name for name in metrics_of(measured) if name in METRICS)):
        sign = 1 if metric in METRICS and METRICS[metric].better == "higher" else -1
        if metric in measured.sequences:
            values = {name: np.array([value]) for name, value in measured.sequences[metric].items()}
        else:
            values = {name: seen.column(metric) for name, seen in measured.seen.items()}
        own, best = values[measured.own], best_of((values[name] for name in measured.rivals), sign)
        known = ~np.isnan(own) & ~np.isnan(best)
        if known.any():
            yield metric, own[known], best[known], standing(own, best, sign)
