"""Invariants of the adaptive pipeline: density is conserved and bounded, tiles cover the image, batches are full."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from analysis.command.cli import BrokenInvariants
from analysis.storage.records import DENSITIES_AND_ERRORS, RecordLimits, checked_fields
from tsar.types import ShownImage, StepRecord

_CONSERVATION = 1e-5
_ROUNDING = 1e-6  # densities are stored as float32


class InvariantCheck:
    """Checks every cycle of a run from its records, as they come. Changes in place."""

    _COUNTED = ("densities_out_of_bounds", "tiling_not_a_cover", "batch_not_full", "nonfinite")

    def __init__(self, limits: RecordLimits) -> None:
        self._limits = limits
        self._found: dict[str, Any] = {"cycles": 0, "conservation_residual": 0.0, **dict.fromkeys(self._COUNTED, 0)}

    def add(self, record: StepRecord) -> None:
        """Checks one cycle; densities are rounded to float32, as in a file."""
        fields = checked_fields(record)
        self.add_fields(fields, record.surplus, record.conservation_residual)

    def add_fields(self, fields: dict[str, np.ndarray], surplus: float, recorded: float) -> None:
        """Checks one cycle from its arrays, the surplus, and the residual that the pipeline recorded."""
        found, limits = self._found, self._limits
        worst = max(_or_infinite(_residual(fields, surplus, limits)), _or_infinite(recorded))
        found["cycles"] += 1
        found["conservation_residual"] = max(found["conservation_residual"], worst)
        found["densities_out_of_bounds"] += not _within(fields, limits)
        found["tiling_not_a_cover"] += not covers_once(fields["tile_level"], fields["tile_index"])
        found["batch_not_full"] += not _full(fields, limits)
        found["nonfinite"] += not all(np.isfinite(fields[name]).all() for name in DENSITIES_AND_ERRORS)

    def result(self) -> dict[str, Any]:
        """Counts and ``ok``."""
        counts = (self._found[name] for name in self._COUNTED)
        kept = self._found["conservation_residual"] <= _CONSERVATION and not any(counts)
        ok = kept and self._found["cycles"] > 0  # a run without cycles does not pass
        return {**self._found, "ok": bool(ok)}


def unbroken(cycles: Iterable[tuple[StepRecord | None, ShownImage]]) -> Iterator[StepRecord]:
    """Records of cycles as they arrive, checked by the pipeline's own counts, which does not disturb time measurements.

    Raises:
        BrokenInvariants: density is not conserved, or a density or an error is not finite.
    """
    for record, _ in cycles:
        if record is None:
            continue
        residual, nonfinite = record.conservation_residual, record.nonfinite_fields
        if not residual <= _CONSERVATION or nonfinite:
            found = f"conservation residual {residual:g}, {nonfinite} values not finite"
            raise BrokenInvariants(f"invariants are broken in cycle {record.cycle}: {found}")
        yield record


def _residual(fields: dict[str, np.ndarray], surplus: float, limits: RecordLimits) -> float:
    combined = fields["density_spatial"].astype(np.float64) * fields["density_temporal"]
    return abs(float(combined.sum()) + surplus - limits.budget) / limits.budget


def _or_infinite(residual: float) -> float:
    """Infinity in place of NaN, which would fail every comparison and so pass as the least residual."""
    return math.inf if math.isnan(residual) else residual


def _within(fields: dict[str, np.ndarray], limits: RecordLimits) -> bool:
    for name in ("density_spatial", "density_temporal"):
        low, high = getattr(limits, name)
        inside = (fields[name] >= low * (1 - _ROUNDING)) & (fields[name] <= high * (1 + _ROUNDING))
        if not inside.all():
            return False
    return True


def covers_once(level: np.ndarray, index: np.ndarray) -> bool:
    """Whether tiles are disjoint intervals that fill the Morton curve: in order, each begins where the last one
    ends."""
    if level.size == 0:
        return False
    shift = 2 * (int(level.max()) - level.astype(np.int64))
    first, last = index.astype(np.int64) << shift, (index.astype(np.int64) + 1) << shift
    order = np.argsort(first, kind="stable")
    first, last = first[order], last[order]
    return bool(first[0] == 0 and last[-1] == 4 ** int(level.max()) and (first[1:] == last[:-1]).all())


def _full(fields: dict[str, np.ndarray], limits: RecordLimits) -> bool:
    selected = fields["selected"]
    distinct = np.unique(selected).size == selected.size == limits.batch_size
    return bool(distinct and selected.min() >= 0 and selected.max() < fields["tile_level"].size)
