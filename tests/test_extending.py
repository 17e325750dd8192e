"""Additions of packages work everywhere: the examples of the documentation, from a checkout and from installed
wheels."""

from __future__ import annotations

import importlib
import json
import os
import re
import subprocess
import sys
import tomllib
from contextlib import ExitStack
from pathlib import Path

import pytest

from analysis.entry import TABLES
from tests.scripts.commands import ROOT
from tsar.named import Named

EXAMPLES = ROOT / "docs/extending"
ADDED = tomllib.loads((EXAMPLES / "pyproject.toml").read_text())["project"]["entry-points"]
GUIDE = ROOT / "docs/guides/extend.md"


def tables() -> dict[str, Named]:
    """Every table by its group of entry points."""
    places = (place.partition(":") for place in TABLES.values())
    found = [getattr(importlib.import_module(module), attribute) for module, _, attribute in places]
    return {table.group: table for table in found}


def assert_used(shown: str) -> None:
    """Whether the output of ``python -m tsar_examples`` shows that everything was used."""
    assert re.search(r"(?m)^interlaced +0\.0", shown) and "edges" in shown
    assert all(f"  {line}\n" in shown for line in ("solver cautious", "norm mean", "reconstruction smooth"))
    pictures = re.findall(r"(?m)^picture.*: (\S+)$", shown)
    assert len(pictures) == 2 and all(0.01 < float(mean) < 5.0 for mean in pictures)


def test_there_is_an_example_for_every_table() -> None:
    assert ADDED.keys() == tables().keys()


def test_the_examples_run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.syspath_prepend(EXAMPLES)
    known = tables()
    with ExitStack() as held:
        for group, entries in ADDED.items():
            held.enter_context(known[group].lent(**entries))
        importlib.import_module("tsar_examples.__main__").main()
    assert_used(capsys.readouterr().out)


def test_the_python_of_the_guide_runs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.syspath_prepend(EXAMPLES)
    compared, policy = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), flags=re.DOTALL)
    exec(compared, {})
    assert re.search(r"(?m)^Interlaced .*", capsys.readouterr().out)
    assert policy == (EXAMPLES / "tsar_examples/policy.py").read_text()


def test_the_guide_counts_files_and_lines_as_they_are() -> None:
    rows = re.findall(r"\| `(\w+\.py)` \| (\d+) \|", GUIDE.read_text())
    counted = {name: len((EXAMPLES / "tsar_examples" / name).read_text().splitlines()) for name, _ in rows}
    assert {name: int(lines) for name, lines in rows} == counted and len(rows) == 10


@pytest.mark.slow
def test_the_examples_run_from_wheels_outside_the_checkout(tmp_path: Path) -> None:
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    options = ["--no-deps", "--no-build-isolation", "--no-index"]
    site = tmp_path / "site"
    for project in (ROOT, EXAMPLES):
        copy = tmp_path / project.name  # a build leaves files beside the project
        listed = ["git", "ls-files", "-co", "--exclude-standard"]
        kept = subprocess.run(listed, cwd=project, capture_output=True, text=True)
        for name in kept.stdout.splitlines():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            (copy / name).write_bytes((project / name).read_bytes())
        wheels = tmp_path / f"{project.name}-wheel"
        subprocess.run([*pip, "wheel", *options, "--wheel-dir", str(wheels), str(copy)], check=True, cwd=tmp_path)
        subprocess.run([*pip, "install", *options, "--target", str(site), *map(str, wheels.iterdir())], check=True)
    environment = {**os.environ, "PYTHONPATH": str(site), "PYTHONSAFEPATH": "1"}

    def run(*command: str) -> str:
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert run(sys.executable, "-c", "import tsar; print(tsar.__file__)").startswith(str(site))
    assert_used(run(sys.executable, "-m", "tsar_examples"))
    listed = run(sys.executable, "-m", "analysis.entry", "list")
    assert "  interlaced           tsar_examples.policy (tsar-examples 1.0)" in listed
    arguments = (
        "pendulum --policy interlaced --rivals framed --metrics edges --seconds 0.1 --resolution-px 64 --batch-size 16"
    )
    run(
        sys.executable,
        "-m",
        "analysis.entry",
        "run",
        *arguments.split(),
        "--batch-size",
        "16",
        "--no-film",
        "--out",
        "out",
    )
    source = json.loads((tmp_path / "out" / "summary.json").read_text())["provenance"]
    assert source["commit"] is None and source["uncommitted_changes"] is None
    added = {(one["kind"], one["name"], one["distribution"], one["version"]) for one in source["added"]}
    named = {"policy": "interlaced", "metric": "edges", "scene": "pendulum"}
    assert added == {(kind, name, "tsar-examples", "1.0") for kind, name in named.items()}
