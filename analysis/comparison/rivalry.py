"""A run beside the best of its rivals, moment by moment and by every metric."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

import numpy as np

from analysis.command.console import Table
from analysis.comparison.summary import Measured, metrics_of
from analysis.metrics import METRICS
from analysis.metrics.arrays import Floats
from analysis.metrics.quality import ratio_statistics
from analysis.metrics.rivals import BEST, Standing, best_of, best_shares, standing
from analysis.page.video import REFERENCE
from analysis.study.cases import is_framed

Image = TypeVar("Image")


@dataclasses.dataclass(frozen=True)
class Panels:
    """The runs that are shown beside the reference: the framed rival of the lowest median error, all other rivals, and
    the run's own policy.

    Attributes:
        own: name of the policy whose rivals the others are.
        best_framed: the framed rival that is shown; None if there is none.
        hidden: the framed rivals that are not shown.
        runs: the runs that are shown, in order.
    """

    own: str
    best_framed: str | None
    hidden: tuple[str, ...]
    runs: tuple[str, ...]

    @classmethod
    def of(cls, mse: Mapping[str, Floats], own: str) -> Panels:
        """Chooses the panels by the errors of all runs."""
        framed = [name for name in mse if name != own and is_framed(name)]
        best = min(framed, key=lambda name: float(np.median(mse[name])), default=None)
        others = [name for name in mse if name != own and name not in framed]
        hidden = tuple(name for name in framed if name != best)
        return cls(own, best, hidden, (*([best] if best else []), *others, own))

    def arranged(self, pictures: Mapping[str, Image]) -> dict[str, Image]:
        """Pictures by label: the reference, the runs that are shown, and all pictures that belong to no run. The label
        of a framed rival that was chosen out of several says so."""
        shown = {name: pictures[name] for name in (REFERENCE, *self.runs) if name in pictures}
        rest = {label: one for label, one in pictures.items() if label not in (*shown, *self.hidden)}
        return {self._label(name): one for name, one in shown.items()} | rest

    def _label(self, name: str) -> str:
        return f"{name} (best framed rival)" if name == self.best_framed and self.hidden else name


def best_rival(measured: Measured) -> dict[str, Any]:
    """The entries of ``summary.json`` on the best rival; empty if there are fewer than two rivals."""
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
    """The run beside the best rival by every metric; None if there are fewer than two rivals."""
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
    """Metric, values of the run and of the best rival at the measured times, and the standing."""
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
