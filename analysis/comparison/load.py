"""A finished run as labelled arrays."""

from __future__ import annotations

import json
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import xarray as xr

from analysis.storage.records import DENSITIES_AND_ERRORS
from analysis.storage.results import SUMMARY
from tsar.morton import raster_to_morton

_SCALARS = ("cost_s", "surplus", "conservation_residual", "nonfinite", "nonfinite_fields", "age_spread_s", "tile_count")


def load(folder: str | PathLike[str]) -> xr.Dataset:
    """A run that ``tsar run`` or :func:`analysis.compare` wrote to a folder.

    Args:
        folder: of a finished run.

    Returns:
        ``mse`` and ``log_mse`` over ``run`` and ``time_s``, the reference times in seconds. The remaining variables
        belong to the policy whose cycles are on disk: the run's own, or else the first rival that records them. Over
        ``cycle`` these are its animation time ``cycle_time_s`` and its numbers; over ``cycle``, ``row`` and
        ``column``, rows from the top of the image, the densities and errors as float32 (16 bytes an element and
        cycle). Attributes are the input, the policy, the ledger, the policy whose cycles these are (``recorded``;
        empty if there is none), and configuration and provenance as JSON.

    Raises:
        FileNotFoundError: the folder has no finished run.
        ValueError: its files are damaged.
    """
    place = Path(fspath(folder))
    summary = json.loads((place / SUMMARY).read_text(encoding="utf-8"))
    runs = list(summary["mse"])
    errors = {
        name: (("run", "time_s"), np.array([summary[name][run] for run in runs], np.float64))
        for name in ("mse", "log_mse")
    }
    found = xr.Dataset(errors, {"run": runs, "time_s": np.array(summary["reference_time_s"], np.float64)})
    if "steps.parquet" in summary["files"]:
        found = found.merge(_cycles(place / "steps.parquet"))
    known = {name: summary[name] for name in ("policy", "ledger")}
    records = {name: json.dumps(summary[name]) for name in ("config", "provenance")}
    return found.assign_attrs(input=summary["config"]["input"], recorded=summary["recorded"] or "", **known, **records)


def _cycles(path: Path) -> xr.Dataset:
    """Every recorded cycle; fields are converted from Morton order to rows and columns."""
    file = pq.ParquetFile(path)
    names = file.schema_arrow.names
    scalars = [name for name in names if name in _SCALARS or name.startswith(("stage_", "count_"))]
    table = file.read(["cycle", "sim_time_s", *scalars])
    cycle = table["cycle"].to_numpy()
    variables: dict[str, Any] = {name: ("cycle", table[name].to_numpy()) for name in scalars}
    for name in DENSITIES_AND_ERRORS:
        variables[name] = (("cycle", "row", "column"), _field(file, name, len(cycle)))
    return xr.Dataset(variables, {"cycle": cycle, "cycle_time_s": ("cycle", table["sim_time_s"].to_numpy())})


def _field(file: pq.ParquetFile, name: str, cycles: int) -> np.ndarray:
    values, row, order = np.empty((0, 0), np.float32), 0, np.empty(0, np.int64)
    for part in file.iter_batches(batch_size=32, columns=[name]):
        flat = part.column(0).flatten().to_numpy().reshape(part.num_rows, -1)
        if row == 0:
            side = round(flat.shape[1] ** 0.5)
            order, values = raster_to_morton(side).numpy(), np.empty((cycles, flat.shape[1]), np.float32)
        values[row : row + part.num_rows] = flat[:, order]
        row += part.num_rows
    side = round(values.shape[1] ** 0.5)
    return values.reshape(cycles, side, side)
