"""Repetitions over inputs: which runs there are, and that finished ones are not repeated."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import analysis.storage.source
from analysis.comparison import inputs_command as script
from analysis.comparison.options import RunOptions
from analysis.comparison.repetitions import InputsOptions, row
from analysis.comparison.stored import complete_run, content_of, finished
from analysis.study.inputs import INPUTS
from scenes import catalog
from tests.scripts.commands import call_script
from tsar.config import ConfigError, TsarConfig

FOUND = {
    "ratio_median": 0.5,
    "ratio_quartiles": [0.4, 0.6],
    "policy": "thesis",
    "ratio_statistics": {"framed": {"median": 0.5}, "framed-1": {"median": 0.75}},
    "best_rival": {"ratio_statistics": {"median": 0.875}},
    "share_suitable": 1.0,
    "suitable_percentile": 100.0,
    "cycles": 7,
    "age_spread_s": 0.01,
    "invariants": {"ok": True},
    "stage_wall_s": {"tracing": 1.0},
}


def test_runs_over_seeds(tmp_path: Path) -> None:
    options = InputsOptions(
        ("chase", "fly-by"), repetitions=3, tsar=TsarConfig(seed=9, batch_size=32), seconds=0.5, out=tmp_path
    )
    runs = options.runs()
    assert [(run.input, run.tsar.seed, run.phase) for run in runs] == [
        (name, seed, 0.0) for name in ("chase", "fly-by") for seed in range(3)
    ]
    assert [run.out for run in runs] == [tmp_path / f"{n}-seed{k}" for n in ("chase", "fly-by") for k in range(3)]
    assert {(run.tsar.batch_size, run.seconds, run.capacity, run.ledger) for run in runs} == {
        (32, 0.5, options.capacity, options.ledger)
    }


def test_runs_over_phases(tmp_path: Path) -> None:
    options = InputsOptions(("chase",), vary="phase", repetitions=4, tsar=TsarConfig(seed=9), out=tmp_path)
    runs = options.runs()
    assert [(run.phase, run.tsar.seed) for run in runs] == [(0.0, 9), (0.25, 9), (0.5, 9), (0.75, 9)]
    assert [run.out.name for run in runs] == ["chase-phase0", "chase-phase1", "chase-phase2", "chase-phase3"]


def test_all_inputs_by_default() -> None:
    runs = InputsOptions().runs()
    assert [run.input for run in runs[::3]] == list(INPUTS) and len({run.out for run in runs}) == len(runs) == 15


@pytest.mark.parametrize("bad", [{"repetitions": 0}, {"inputs": ()}, {"rivals": ()}, {"rivals": ("magic",)}])
def test_nothing_to_run_is_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=next(iter(bad))):
        InputsOptions(**bad)


def test_a_row_says_which_run_it_was(tmp_path: Path) -> None:
    run = RunOptions("chase", TsarConfig(seed=4), phase=0.5, out=tmp_path / "chase-seed4")
    found = row(run, FOUND)
    assert (found["run"], found["input"], found["seed"], found["phase"]) == ("chase-seed4", "chase", 4, 0.5)
    assert found["ratio_median"] == 0.5 and found["invariants_ok"] is True
    assert found["ratio_medians"] == {"framed": 0.5, "framed-1": 0.75, "best-rival": 0.875}
    alone = {name: value for name, value in FOUND.items() if name != "best_rival"}
    assert row(run, {**alone, "ratio_statistics": {"afr": {"median": 0.8}}})["ratio_medians"] == {"afr": 0.8}


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Stands in for the experiment: writes records and a summary. Holds the names of the runs that were made."""
    names: list[str] = []

    def pretend(options: RunOptions) -> dict[str, Any]:
        names.append(options.out.name)
        scene, _ = catalog.load_any(options.input, options.phase)
        found = {**FOUND, "provenance": {"content": content_of(options, scene)}}
        options.out.mkdir(exist_ok=True)
        (options.out / "steps.parquet").write_bytes(b"records of " + options.out.name.encode())
        complete_run(options, found)
        return found

    monkeypatch.setattr(script, "run_experiment", pretend)
    return names


def test_finished_runs_are_not_repeated(
    made: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    arguments = ("fly-by", "--repetitions", "2", "--out", str(tmp_path))
    assert call_script("inputs.py", monkeypatch, *arguments) == 0
    assert made == ["fly-by-seed0", "fly-by-seed1"]
    shown = capsys.readouterr().out
    (line,) = (line for line in shown.splitlines() if "fly-by-seed0" in line)
    assert line.replace("│", " ").split() == ["fly-by-seed0", *"0.500 0.400 – 0.600 100 0.750 0.875".split()]

    assert call_script("inputs.py", monkeypatch, *arguments) == 0
    assert made == ["fly-by-seed0", "fly-by-seed1"] and capsys.readouterr().out == shown

    (tmp_path / "fly-by-seed1" / "summary.json").unlink()
    assert call_script("inputs.py", monkeypatch, *arguments) == 0
    assert made[2:] == ["fly-by-seed1"], "what was interrupted is run again"

    assert call_script("inputs.py", monkeypatch, *arguments, "--seconds", "1") == 0
    assert made[3:] == ["fly-by-seed0", "fly-by-seed1"], "other options, other runs"


def test_runs_by_other_code_are_repeated(made: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ("fly-by", "--repetitions", "1", "--out", str(tmp_path))
    assert call_script("inputs.py", monkeypatch, *arguments) == 0
    monkeypatch.setattr(analysis.storage.source, "code_hash", lambda *makers: "upgraded")
    for _ in range(2):
        assert call_script("inputs.py", monkeypatch, *arguments) == 0
    assert made == ["fly-by-seed0"] * 2


@pytest.mark.parametrize("damage", ["lost", "bit", "exchanged"])
@pytest.mark.parametrize("name", ["summary.json", "steps.parquet"])
def test_a_damaged_run_is_named_and_repeated(
    name: str,
    damage: str,
    made: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    arguments = ("fly-by", "--repetitions", "2", "--out", str(tmp_path))
    assert call_script("inputs.py", monkeypatch, *arguments) == 0
    shown, file = capsys.readouterr().out, tmp_path / "fly-by-seed1" / name
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    if damage == "bit":
        file.write_bytes(content)
    elif damage == "exchanged":
        file.write_bytes((tmp_path / "fly-by-seed0" / name).read_bytes())
    else:
        file.unlink()
    assert call_script("inputs.py", monkeypatch, *arguments) == 0
    again = capsys.readouterr()
    assert made[2:] == ["fly-by-seed1"] and again.out == shown
    assert (f"{file}: is damaged" in again.err) == (damage != "lost")


def test_a_run_of_a_scene_that_was_edited_is_not_finished(tmp_path: Path) -> None:
    scene = tmp_path / "scene.pbrt"
    text = 'Camera "perspective" WorldBegin LightSource "distant" "rgb L" [1 1 1] Shape "sphere" WorldEnd'
    scene.write_text(text)
    options = RunOptions(str(scene), out=tmp_path)
    content = content_of(options, catalog.load_any(str(scene))[0])
    complete_run(options, {**FOUND, "provenance": {"content": content}})
    assert finished(options) is not None
    scene.write_text(text.replace("[1 1 1]", "[1 2 1]"))
    assert finished(options) is None


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", '{"provenance": {}}', '{"provenance": {"content": "other"}}'])
def test_summaries_of_something_else_do_not_count(
    made: list[str], content: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "fly-by-seed0").mkdir()
    (tmp_path / "fly-by-seed0" / "summary.json").write_text(content)
    assert call_script("inputs.py", monkeypatch, "fly-by", "--repetitions", "1", "--out", str(tmp_path)) == 0
    assert made == ["fly-by-seed0"]


def test_the_summary_holds_every_run(made: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ("chase", "fly-by", "--vary", "phase", "--repetitions", "2", "--ledger", "work", "--out", str(tmp_path))
    assert call_script("inputs.py", monkeypatch, *arguments) == 0
    found = json.loads((tmp_path / "summary.json").read_text())
    assert [(one["run"], one["phase"]) for one in found["runs"]] == [
        ("chase-phase0", 0.0),
        ("chase-phase1", 0.5),
        ("fly-by-phase0", 0.0),
        ("fly-by-phase1", 0.5),
    ]
    assert found["ledger"] == "work" and found["config"]["repetitions"] == 2 and found["provenance"]["device"] == "cpu"
