"""Every command that runs the adaptive pipeline ends with status 3 where a run breaks an invariant."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import pytest

import analysis.storage.invariants
from analysis.bench.cycles import cycles, synthetic_trace
from analysis.command.cli import BrokenInvariants
from analysis.command.progress import Task
from analysis.cost_report.measurement import measure_cells, prepare, watch_memory
from analysis.cost_report.options import MeasurementOptions
from analysis.perception import adaptive
from analysis.perception.options import AdaptiveOptions
from analysis.study.cases import SCALES
from tests.scripts.commands import call_script
from tsar.config import TsarConfig

SMALL = ("--resolution-px", "64", "--batch-size", "16", "--warmup-cycles", "4", "--seconds", "0.1")
TINY = TsarConfig(batch_size=16, resolution_px=64, sdf_side=16, cache_size=64, warmup_cycles=2)
BROKEN = {"ok": False, "conservation_residual": 0.74}


@pytest.fixture
def strict(monkeypatch: pytest.MonkeyPatch) -> None:
    """No residual is small enough."""
    monkeypatch.setattr(analysis.storage.invariants, "_CONSERVATION", -1.0)


def last_line(capsys: pytest.CaptureFixture) -> str:
    return capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("stages", ["compiled", "reference"])
def test_a_comparison(
    stages: str, strict: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    places = ("--out", str(tmp_path / "out"), "--references", str(tmp_path / "cache"))
    rest = ("--reference-samples-per-axis", "1", "--reference-rate-hz", "20", "--no-film", "--stages", stages)
    rest += ("--capacity", "8.7e10", "--policy", "thesis", "--rivals", "framed")  # thesis has invariants
    assert call_script("run.py", monkeypatch, "fly-by", *SMALL, *rest, *places) == 3
    assert last_line(capsys) == "error: invariants are broken in 1 runs: fly-by"
    assert (tmp_path / "out" / "summary.json").exists(), "what was found can be looked at"


def test_inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    script = importlib.import_module("analysis.comparison.inputs_command")
    names = "ratio_median", "share_suitable", "suitable_percentile"
    whole = {
        **dict.fromkeys((*names, "cycles", "age_spread_s"), 1.0),
        "ratio_quartiles": [1.0, 1.0],
        "ratio_statistics": {"framed": {"median": 1.0}},
        "stage_wall_s": {},
    }
    kinds = iter([{"ok": True}, BROKEN])
    monkeypatch.setattr(script, "run_experiment", lambda options: {**whole, "invariants": next(kinds)})
    arguments = ("fly-by", "--repetitions", "2", "--out", str(tmp_path))
    assert call_script("inputs.py", monkeypatch, *arguments) == 3
    assert last_line(capsys) == "error: invariants are broken in 1 runs: fly-by-seed1"


def test_a_suitability_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    import analysis.suitability.page as page
    import analysis.suitability.run as report

    summary = {"failures": {}, "runs": 1, "runs_done": 1, "broken_invariants": ["thesis-fly-by"]}
    monkeypatch.setattr(report, "study", lambda options: (summary, {}))
    monkeypatch.setattr(page, "shown_tables", lambda tables: [])
    assert call_script("suitability.py", monkeypatch, "--out", str(tmp_path)) == 3
    assert last_line(capsys) == "error: invariants are broken in 1 runs: thesis-fly-by"


def test_measurements_of_time(strict: None) -> None:
    with pytest.raises(BrokenInvariants, match="broken in cycle -2"):
        next(cycles(TINY, synthetic_trace))


def test_a_measurement_of_cost(strict: None) -> None:
    settings = MeasurementOptions(
        measured_batches=(4, 8, 16), measured_resolutions=(64, 128, 256), measured_batch=16, measured_resolution=64,
        measured_warmup=6, memory_cycles=40, threads=1,
    )  # fmt: skip
    scene, renderers = prepare(settings)
    with pytest.raises(BrokenInvariants):
        measure_cells(settings, renderers, Task())
    with pytest.raises(BrokenInvariants):
        watch_memory(settings, renderers[64], scene.duration_s, Task())


def test_adaptive_rendering_before_an_observer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adaptive, "run_cases", lambda cases, *rest: ({case: case.name for case in cases}, {}))

    def finished(key: str, place: Any) -> dict[str, Any]:
        return {"key": key, "jod": 9.0, **({"invariants": BROKEN} if key.startswith("thesis-fly-by-b8-") else {})}

    monkeypatch.setattr(adaptive, "finished", finished)
    options = AdaptiveOptions(inputs=("fly-by",), scale="quick", out=tmp_path, references=tmp_path)
    with pytest.raises(BrokenInvariants, match="in 1 runs: thesis-fly-by-b8-128px"):
        adaptive.scores(options, Task())
    assert SCALES["quick"].config(7, TsarConfig()).batch_size == 8
