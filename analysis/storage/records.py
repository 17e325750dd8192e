"""Run records on disk: one Parquet row a pipeline cycle."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from torch import Tensor

from analysis.storage.files import PARTIAL, plain
from tsar.types import StepRecord

META = b"tsar"
"""Key of the limits in the metadata of a file."""

DENSITIES_AND_ERRORS = ("density_spatial", "density_temporal", "error_spatial", "error_temporal")
"""Columns that hold a field."""

_FIELDS: dict[str, pa.DataType] = {
    "cycle": pa.int64(),
    "sim_time_s": pa.float64(),
    "cost_s": pa.float64(),
    "surplus": pa.float64(),
    "conservation_residual": pa.float64(),
    "nonfinite": pa.int64(),
    "nonfinite_fields": pa.int64(),
    "age_spread_s": pa.float64(),
    "tile_count": pa.int32(),
    "tile_level": pa.list_(pa.int8()),
    "tile_index": pa.list_(pa.int32()),
    "selected": pa.list_(pa.int32()),
    **dict.fromkeys(DENSITIES_AND_ERRORS, pa.list_(pa.float32())),
}


@dataclass(frozen=True)
class RecordLimits:
    """Limits that every cycle of a run must keep; stored with the records, so that a file can be checked alone.

    Attributes:
        batch_size: framelets per cycle.
        budget: samples per cycle.
        density_spatial, density_temporal: least and greatest density, samples per element and refreshes per cycle.
    """

    batch_size: int
    budget: float
    density_spatial: tuple[float, float]
    density_temporal: tuple[float, float]


def _flat(tensor: Tensor, dtype: type) -> np.ndarray:
    return tensor.detach().cpu().numpy().astype(dtype)


def checked_fields(record: StepRecord) -> dict[str, np.ndarray]:
    """The arrays of a record on which its invariants are checked, as they are stored."""
    return {
        "tile_level": _flat(record.tiling.level, np.int8),
        "tile_index": _flat(record.tiling.index, np.int32),
        "selected": _flat(record.selected, np.int32),
        "density_spatial": _flat(record.densities.spatial, np.float32),
        "density_temporal": _flat(record.densities.temporal, np.float32),
        "error_spatial": _flat(record.errors.spatial, np.float32),
        "error_temporal": _flat(record.errors.temporal, np.float32),
    }


class StepWriter:
    """Streams step records to Parquet in row groups; the file appears under its name when it is closed without error.

    Columns ``stage_<name>_s`` hold measured stage seconds and ``count_<name>`` counters, named by the first record.
    Densities and errors are float32, Morton order.
    """

    def __init__(self, path: Path, limits: RecordLimits, rows_per_group: int = 32) -> None:
        self.path = path
        self.rows = 0
        self._temporary = path.with_name(f"{path.stem}{PARTIAL}{path.suffix}")
        self._limits = limits
        self._rows_per_group = rows_per_group
        self._pending: list[dict[str, Any]] = []
        self._writer: pq.ParquetWriter | None = None

    def __enter__(self) -> StepWriter:
        return self

    def __exit__(self, kind: type | None, *_: object) -> None:
        self.close(keep=kind is None)

    def add(self, record: StepRecord) -> None:
        """Appends one cycle."""
        row: dict[str, Any] = {
            "cycle": record.cycle,
            "sim_time_s": record.sim_time_s,
            "cost_s": record.cost_s,
            "surplus": record.surplus,
            "conservation_residual": record.conservation_residual,
            "nonfinite": record.nonfinite,
            "nonfinite_fields": record.nonfinite_fields,
            "age_spread_s": record.age_spread_s,
            "tile_count": record.tiling.tile_count,
            **checked_fields(record),
        }
        row |= {f"stage_{name}_s": seconds for name, seconds in record.stage_s.items()}
        row |= {f"count_{name}": count for name, count in record.counters.items()}
        self._pending.append(row)
        self.rows += 1
        if len(self._pending) >= self._rows_per_group:
            self._flush()

    def _flush(self) -> None:
        if not self._pending:
            return
        if self._writer is None:
            self._writer = self._open(self._pending[0])
        schema = self._writer.schema
        table = pa.Table.from_pydict(
            {name: [row.get(name) for row in self._pending] for name in schema.names}, schema=schema
        )
        self._writer.write_table(table)
        self._pending.clear()

    def _open(self, first: dict[str, Any]) -> pq.ParquetWriter:
        columns = dict(_FIELDS)
        columns |= {name: pa.float64() for name in first if name.startswith("stage_")}
        columns |= {name: pa.int64() for name in first if name.startswith("count_")}
        schema = pa.schema(columns, metadata={META: json.dumps(plain(self._limits)).encode()})
        self._temporary.parent.mkdir(parents=True, exist_ok=True)
        return pq.ParquetWriter(self._temporary, schema, compression="zstd")

    def close(self, keep: bool = True) -> None:
        """Ends the file; without ``keep``, or if ending it fails, no file stays on disk."""
        try:
            if keep:
                self._flush()
            if self._writer is not None:
                self._writer.close()
                if keep:
                    os.replace(self._temporary, self.path)
        finally:
            self._writer = None
            self._temporary.unlink(missing_ok=True)


def density_quantiles(path: Path, percents: tuple[float, ...] = (5.0, 25.0, 50.0, 75.0, 95.0)) -> dict[str, np.ndarray]:
    """Densities over time: ``sim_time_s`` (cycles,), and quantiles of both densities over the elements (cycles,
    percents)."""
    names = ("density_spatial", "density_temporal")
    found: dict[str, list] = {"sim_time_s": [], **{name: [] for name in names}}
    for part in pq.ParquetFile(path).iter_batches(batch_size=32, columns=list(found)):
        found["sim_time_s"].extend(part.column("sim_time_s").to_pylist())
        for name in names:
            for row in part.column(name):
                found[name].append(np.percentile(row.values.to_numpy(), percents))
    return {name: np.asarray(values) for name, values in found.items()}


def stage_seconds(path: Path, most: int = 120) -> tuple[list[float], dict[str, np.ndarray]]:
    """Wall seconds of the stages of a cycle over time, as medians over at most ``most`` groups of consecutive cycles.

    Returns:
        Time of the first cycle of each group, seconds, and the medians of each stage.
    """
    file = pq.ParquetFile(path)
    names = [name for name in file.schema_arrow.names if name.startswith("stage_")]
    table = file.read(["sim_time_s", *names])
    starts = np.arange(0, table.num_rows, max(1, -(-table.num_rows // most)))
    times = table["sim_time_s"].to_numpy()[starts].tolist()
    stages = {name: np.split(table[name].to_numpy(), starts[1:]) for name in names}
    medians = {name: np.array([np.median(part) for part in parts]) for name, parts in stages.items()}
    return times, {name.removeprefix("stage_").removesuffix("_s"): values for name, values in medians.items()}
