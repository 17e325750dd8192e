"""The cost report from the command line, without a measurement, and one line for bad input."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import pyvista
from PIL import Image

from tests.analysis.cost_report.test_run import TABLE_7_2
from tests.scripts.commands import assert_refused, call_script, run_script


def test_a_report_without_a_measurement(tmp_path: Path) -> None:
    done = run_script("cost_report.py", tmp_path, "--no-measure", "--out", "out")
    assert done.returncode == 0 and done.stderr == "", done.stderr
    for part in (
        "Ledger thesis",
        "Ledger printed",
        "Ledger summed",
        "reconstruction",
        "6.80",
        "4.26",
        "1.20",
        "16 rows",
    ):
        assert part in done.stdout
    found = sorted(path.name for path in (tmp_path / "out").iterdir() if path.name != "files.journal")
    figures = [f"fig_7_{number}.png" for number in (3, 4, 5, 6)]
    vectors = ["advantage.svg", *(f"fig_7_{number}.svg" for number in (3, 4, 5, 6))]
    assert found == sorted(["advantage.png", "fig_7_6.vtp", "summary.json", *figures, *vectors])
    assert all(name in done.stdout for name in found if name not in vectors)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["admitted"] == [list(row) for row in TABLE_7_2]
    assert summary["flops_per_pixel"]["nonadaptive"] == 51_680
    cycle = summary["flops_per_cycle"]["adaptive"]
    assert cycle["total"] == pytest.approx(sum(value for name, value in cycle.items() if name != "total"))
    assert 980 < summary["crossing_batch"] < 1024 and summary["measurement"] is None
    assert summary["config"]["parameters"]["tree_size"] == 1024 and len(summary["provenance"]["config_hash"]) == 16
    for name in (*figures, "advantage.png"):
        with Image.open(tmp_path / "out" / name) as picture:
            assert min(picture.size) > 300 and np.asarray(picture.convert("L"), float).std() > 5.0
    surface = pyvista.read(tmp_path / "out" / "fig_7_6.vtp")
    assert surface.n_points > 1000 and np.abs(surface["ratio"] - 1.0).max() < 0.01


def test_parameters_come_from_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = (
        "--no-measure",
        "--ledger",
        "summed",
        "--batch-size",
        "64",
        "--recon-res",
        "65536",
        "--tree-size",
        "256",
    )
    grid = ("--batches", "16", "64", "--resolutions", "512", "--admitted-segments", "6")
    assert call_script("cost_report.py", monkeypatch, *arguments, *grid, "--out", str(tmp_path)) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["ledger"] == "summed"
    assert summary["flops_per_cycle"]["adaptive"]["tracing"] == 64 * 256 * 5 * (8 * 16 + 64 + 96)
    assert summary["flops_per_cycle"]["nonadaptive"] == 65536 * 5 * (8 * 16 + 64 + 96)
    assert summary["admitted"] == [[16, 512], [64, 512]]


def test_a_folder_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    (tmp_path / "file").write_text("kept")
    status = call_script("cost_report.py", monkeypatch, "--no-measure", "--out", str(tmp_path / "file" / "below"))
    assert_refused(status, capsys, ("out: cannot write to", str(tmp_path / "file")))
    assert (tmp_path / "file").read_text() == "kept"
