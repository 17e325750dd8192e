"""Step records: what is written comes back, and an interrupted write leaves nothing."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import torch

from analysis.storage.records import StepWriter, density_quantiles, stage_seconds
from tests.analysis.builders import ELEMENTS, LIMITS, good_record
from tests.oracles.steps import read_limits
from tsar.types import StepRecord


def write(path: Path, records: Iterable[StepRecord], rows_per_group: int = 32) -> Path:
    with StepWriter(path, LIMITS, rows_per_group) as writer:
        for record in records:
            writer.add(record)
    return path


def test_records_stream_to_disk_and_come_back(tmp_path: Path) -> None:
    path, records = tmp_path / "new" / "steps.parquet", [good_record(i) for i in range(10)]
    with StepWriter(path, LIMITS, rows_per_group=4) as writer:
        for number, record in enumerate(records):
            writer.add(record)
            assert len(writer._pending) == (number + 1) % 4, "no more than a group is held"
        assert not path.exists() and len(list(path.parent.iterdir())) == 1
    assert [p.name for p in path.parent.iterdir()] == ["steps.parquet"] and writer.rows == 10
    assert pq.ParquetFile(path).num_row_groups == 3 and read_limits(path) == LIMITS
    for record, row in zip(records, pq.read_table(path).to_pylist(), strict=True):
        for name in ("cycle", "sim_time_s", "cost_s", "surplus", "conservation_residual", "nonfinite", "age_spread_s"):
            assert row[name] == getattr(record, name), name
        assert row["tile_count"] == record.tiling.tile_count
        assert row["tile_level"] == record.tiling.level.tolist() and row["tile_index"] == record.tiling.index.tolist()
        assert row["selected"] == record.selected.tolist()
        assert row["density_spatial"] == record.densities.spatial.float().tolist()
        assert row["density_temporal"] == record.densities.temporal.float().tolist()
        assert row["error_spatial"] == [0.5] * ELEMENTS and row["error_temporal"] == [-0.25] * ELEMENTS
        assert (row["stage_tracing_s"], row["stage_error_s"]) == (0.5, 0.25)
        assert (row["count_primary_rays"], row["count_shadow_rays"]) == (1024, 10)


def test_the_columns_are_those_that_the_guide_lists(tmp_path: Path) -> None:
    guide = (Path(__file__).resolve().parents[3] / "docs/guides/compare.md").read_text(encoding="utf-8")
    _, _, table = guide.partition("| column | values | what |\n|---|---|---|\n")
    listed = [
        name for row in table.split("\n\n")[0].splitlines() for name in re.findall(r"`([^`]+)`", row.split("|")[1])
    ]
    written = pq.read_schema(write(tmp_path / "steps.parquet", [good_record(0)])).names
    assert [name for name in written if not any(fnmatch(name, one) for one in listed)] == []
    assert [one for one in listed if not any(fnmatch(name, one) for name in written)] == []


@pytest.mark.parametrize("added", [0, 1, 9])
def test_an_interrupted_write_leaves_only_the_old_file(tmp_path: Path, added: int) -> None:
    path = tmp_path / "steps.parquet"
    for before in ([], ["steps.parquet"]):
        with pytest.raises(KeyboardInterrupt), StepWriter(path, LIMITS, rows_per_group=4) as writer:
            for number in range(added):
                writer.add(good_record(number))
            raise KeyboardInterrupt
        assert [p.name for p in tmp_path.iterdir()] == before
        write(path, [good_record(1)])
    assert pq.read_table(path).num_rows == 1


def test_a_failure_at_the_very_end_leaves_nothing(tmp_path: Path) -> None:
    """The last rows go to disk after the block: an error there counts too."""
    with pytest.raises(OverflowError), StepWriter(tmp_path / "steps.parquet", LIMITS, rows_per_group=2) as writer:
        writer.add(good_record(0))
        writer.add(good_record(1))
        writer.add(good_record(2, counters={"primary_rays": 2**70}))
    assert list(tmp_path.iterdir()) == []


def test_density_quantiles(tmp_path: Path) -> None:
    ramp = torch.linspace(1.0, 2.0, ELEMENTS, dtype=torch.float64)
    records = [good_record(i, spatial=ramp + i, temporal=ramp / 4) for i in range(40)]
    found = density_quantiles(write(tmp_path / "a.parquet", records, 9), (0.0, 50.0, 100.0))
    assert np.allclose(found["sim_time_s"], 0.01 * np.arange(40))
    assert np.allclose(found["density_spatial"], np.array([1.0, 1.5, 2.0]) + np.arange(40)[:, None])
    assert np.allclose(found["density_temporal"], np.tile([0.25, 0.375, 0.5], (40, 1)))


@pytest.mark.parametrize(("cycles", "groups"), [(7, 7), (120, 120), (121, 61), (240, 120), (241, 81)])
def test_seconds_of_stages_are_medians_of_groups_of_cycles(cycles: int, groups: int, tmp_path: Path) -> None:
    """At most 120, of equally many cycles but for the last."""
    records = [good_record(i, stage_s={"tracing": float(i), "error": 1.0}) for i in range(cycles)]
    times_s, stages = stage_seconds(write(tmp_path / "a.parquet", records))
    each = -(-cycles // groups)
    starts = np.arange(0, cycles, each)
    assert len(times_s) == groups and times_s == pytest.approx(0.01 * starts)
    assert stages["tracing"].tolist() == [np.median(range(at, min(at + each, cycles))) for at in starts]
    assert stages["error"].tolist() == [1.0] * groups
