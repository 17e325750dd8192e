"""Text on the terminal appears unchanged, whatever brackets and colons a path or a name contains."""

import ast
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from analysis.command.console import frame_table, markdown, show
from analysis.command.progress import bars
from analysis.comparison import run_command
from analysis.page.report import Report, render
from tests.scripts.commands import call_script

ROOT = Path(__file__).resolve().parents[3]
ODD = "a[/b] [red]c :smile: [bold"


def test_text_is_printed_as_it_is(capsys: pytest.CaptureFixture) -> None:
    show(f"written to {ODD}", frame_table(pd.DataFrame({ODD: [ODD]}), title=f"of {ODD}"))
    printed = capsys.readouterr().out
    assert f"written to {ODD}" in printed and f"of {ODD}" in printed and printed.count(ODD) == 4


def test_tables_without_rows_are_left_out(capsys: pytest.CaptureFixture) -> None:
    tables = [frame_table(pd.DataFrame({"a": [1]}), "given"), frame_table(pd.DataFrame({"a": []}), "lacking")]
    show(*tables)
    for text in (capsys.readouterr().out, markdown(tables), render(Report("t", [], tables[1], tables=tables))):
        assert "given" in text and "lacking" not in text


def test_bars_show_names_as_they_are(capsys: pytest.CaptureFixture) -> None:
    with bars() as shown:
        shown.task(ODD, 2).advance()
        shown.say(f"made {ODD}")
    assert f"made {ODD}" in capsys.readouterr().err


def test_a_run_prints_its_folder_as_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, tmp_path: Path
) -> None:
    statistics = types.SimpleNamespace(median=1.0, quartile_low=0.9, quartile_high=1.1, share_suitable=0.5)
    statistics.suitable_percentile = 50.0
    summary: dict[str, Any] = {"ratio_statistics": {"framed": statistics}, "policy": "thesis", "metrics": {}}
    summary |= {"mse": {"thesis": [0.1], "framed": [0.2]}, "config": {}}
    summary |= {"files": [], "choice": None, "ledger": "thesis", "cycles": 1, "cycle_s": 0.1}
    summary |= {"samples_traced": 1, "invariants": {"ok": True, "runs": ["thesis"]}, "nonfinite": {"samples": 0}}
    monkeypatch.setattr(run_command, "run_experiment", lambda options, began_s: summary)
    monkeypatch.chdir(tmp_path)
    assert call_script("run.py", monkeypatch, "fly-by", "--out", ODD) == 0
    assert f"written to {ODD}" in capsys.readouterr().out


def consoles(tree: ast.AST) -> Iterator[ast.Call]:
    """Calls that make a console of rich's."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) == "Console":
            yield node


def test_no_console_reads_markup() -> None:
    found = 0
    for package in ("analysis", "renderer", "scenes", "scripts", "tsar"):
        for path in (ROOT / package).rglob("*.py"):
            for call in consoles(ast.parse(path.read_text(encoding="utf-8"))):
                given = {one.arg: ast.unparse(one.value) for one in call.keywords}
                assert given.get("markup") == given.get("emoji") == "False", f"{path}:{call.lineno}"
                found += 1
    assert found > 0
