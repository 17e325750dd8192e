"""Step records read from their file alone: the limits, and invariants checked cycle by cycle."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from analysis.storage.invariants import InvariantCheck
from analysis.storage.records import DENSITIES_AND_ERRORS, META, RecordLimits


def read_limits(path: Path) -> RecordLimits:
    """The limits stored with a file of step records."""
    found = json.loads(pq.read_schema(path).metadata[META])
    return RecordLimits(
        found["batch_size"], found["budget"], tuple(found["density_spatial"]), tuple(found["density_temporal"])
    )


def check_invariants(path: Path) -> dict[str, Any]:
    """What a check finds in a file of step records."""
    check = InvariantCheck(read_limits(path))
    names = ["tile_level", "tile_index", "selected", *DENSITIES_AND_ERRORS]
    for row in range((table := pq.read_table(path)).num_rows):
        fields = {name: table.column(name)[row].values.to_numpy() for name in names}
        surplus, residual = (table.column(name)[row].as_py() for name in ("surplus", "conservation_residual"))
        check.add_fields(fields, surplus, residual)
    return check.result()
