"""Comparison of two folders: what counts as a difference, and where two equal runs may differ."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from PIL import Image

from analysis.storage.sameness import compare_folders

SUMMARY = {"mse": [0.25, 0.5], "wall_s": 1.0, "effects": {"glass": {"samples_per_s": 3.0}}, "config": {"out": "a"}}


def steps(place: Path, mse: float, lists: list[list[float]], seconds: list[float]) -> None:
    table = pa.table({"mse": [mse, np.nan], "list": lists, "stage_s": seconds})
    pq.write_table(table, place / "steps.parquet")


def folder(place: Path) -> Path:
    """Results of every kind."""
    place.mkdir()
    (place / "summary.json").write_text(json.dumps(SUMMARY))
    (place / "table.csv").write_text("run,mse\na,0.25\n")
    (place / "timing.csv").write_text("run,seconds\na,1.0\n")
    (place / "report.html").write_text("one")
    steps(place, 0.25, [[1.0, np.nan], []], [1.0, 2.0])
    Image.fromarray(np.zeros((2, 2, 3), np.uint8)).save(place / "shown.png")
    return place


def test_measured_seconds_are_no_difference(tmp_path: Path) -> None:
    first, second = folder(tmp_path / "first"), folder(tmp_path / "second")
    measured = {"wall_s": 2.0, "effects": {"glass": {"samples_per_s": 9.0}}, "config": {"out": "b"}}
    (second / "summary.json").write_text(json.dumps({**SUMMARY, **measured}))
    (second / "timing.csv").write_text("run,seconds\na,7.0\n")
    (second / "report.html").write_text("two")
    steps(second, 0.25, [[1.0, np.nan], []], [5.0, 5.0])
    found = compare_folders(first, second)
    assert found.found == [] and found.compared == 4 and sorted(found.left_out) == ["report.html", "timing.csv"]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("summary.json", json.dumps({**SUMMARY, "mse": [0.25, 0.51]}), r"mse[1]: 0.5 and 0.51"),
        ("summary.json", json.dumps({**SUMMARY, "more": 1}), "more: only in one of them"),
        ("table.csv", "run,mse\na,0.26\n", "other bytes"),
        ("further.csv", "", "missing in"),
    ],
)
def test_what_differs_is_named(tmp_path: Path, name: str, content: str, said: str) -> None:
    first, second = folder(tmp_path / "first"), folder(tmp_path / "second")
    (second / name).write_text(content)
    (line,) = compare_folders(first, second).found
    assert line.startswith(f"{name}: ") and said in line


def test_numbers_of_tables_and_pixels_are_compared(tmp_path: Path) -> None:
    first, second = folder(tmp_path / "first"), folder(tmp_path / "second")
    steps(second, 0.26, [[1.0], [np.nan]], [1.0, 2.0])
    Image.fromarray(np.eye(2, dtype=np.uint8)[..., None].repeat(3, 2)).save(second / "shown.png")
    expected = ["shown.png: 6 of 12 values of its pixels differ"]
    expected += [f"steps.parquet: column {name}: other values" for name in ("mse", "list")]
    assert compare_folders(first, second).found == expected
    assert compare_folders(first, second, ignore=("mse", "list", "shown.png")).found == []


def test_folders_without_results_are_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match="expected results, found no files"):
        compare_folders(tmp_path / "empty", tmp_path / "empty")
    with pytest.raises(ValueError, match="expected a folder of results"):
        compare_folders(tmp_path / "empty", tmp_path / "none")
