"""What the mutation tests change, and which tests they run."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.mutants import interval, mutants_of, never_run
from tests.test_architecture import ROOT
from tests.trials import Record, function_at

SOURCE = """from __future__ import annotations
if TYPE_CHECKING:
    LIMIT = 1 + 1

def outer(a: int | None = 2 + 3) -> int | None:
    b: int | None = 4
    def inner():
        return a + b
    return inner

class Kept:
    size: int = 5

    @property
    def area(self):
        return self.size * self.size
"""


def test_annotations_and_what_type_checkers_read_are_not_changed() -> None:
    pytest.importorskip("cosmic_ray")
    found = list(mutants_of("a.py", SOURCE))
    assert {one.line for one in found} == {5, 6, 8, 12, 14, 16}
    assert not any("Operator_BitOr" in one.operator for one in found), "no mutant of a union"
    changed = [one.applied(SOURCE) for one in found]
    assert all(one is None or one != SOURCE for one in changed)
    lines = {text.splitlines()[4] for text in changed if text}
    assert "def outer(a: int | None = 2 - 3) -> int | None:" in lines


def test_a_change_that_is_not_python_is_no_mutant() -> None:
    pytest.importorskip("cosmic_ray")
    source = "found = {**a, **b}\n"
    assert all(one.applied(source) is None for one in mutants_of("a.py", source) if "Pow" in one.operator)


def test_lines_that_run_at_import_belong_to_no_function() -> None:
    tree = ast.parse(SOURCE)
    named = {line: function_at(tree, line) for line in range(1, 17)}
    assert named[6] == named[9] == "outer" and named[8] == "outer.<locals>.inner" and named[16] == "Kept.area"
    assert {named[line] for line in (1, 3, 5, 12, 14)} == {None}
    assert len(never_run(tree)) == 5


def test_the_interval_of_a_share() -> None:
    assert interval(90, 100) == pytest.approx((0.8256, 0.9448), abs=1e-4)  # Wilson's, z = 1.96


def test_what_each_test_calls_is_noted(tmp_path: Path) -> None:
    """In a process of its own: a fixture counts for all tests, another process for everything."""
    (tmp_path / "counted.py").write_text(SOURCE.replace("TYPE_CHECKING", "False"))
    (tmp_path / "test_it.py").write_text(
        "import subprocess, sys\nimport pytest\nimport counted\n"
        "@pytest.fixture\ndef kept():\n    return counted.Kept().area\n"
        "def test_one(kept): counted.outer(1)()\n"
        "def test_two(): pass\n"
        "def test_three(): subprocess.run([sys.executable, '-c', ''])\n"
    )
    run = (
        "import sys, pytest\nfrom pathlib import Path\nfrom tests.reach import Noted\n"
        "sys.path.insert(0, '.')\nsys.exit(pytest.main(['-q', '-p', 'no:cacheprovider', 'test_it.py'],"
        " [Noted(Path.cwd(), Path('found.json'))]))"
    )
    done = subprocess.run([sys.executable, "-c", run], cwd=tmp_path, env={"PYTHONPATH": str(ROOT)}, capture_output=True)
    assert done.returncode == 0, done.stdout
    found = json.loads((tmp_path / "found.json").read_text())
    called = {name.partition("::")[2]: set(places) for name, (_, places) in found["tests"].items()}
    assert {"counted.py:outer", "counted.py:outer.<locals>.inner"} <= called["test_one"]
    assert "counted.py:Kept.area" in found["shared"] and called["test_two"] == {"test_it.py:test_two"}
    assert "*:" in called["test_three"]


def test_a_line_that_a_kill_cut_off_is_found_again(tmp_path: Path) -> None:
    path = tmp_path / "found.jsonl"
    Record(path).put("a", killed=True)
    path.write_text(path.read_text() + '{"key": "b", "kil')
    record = Record(path)
    assert set(record.found) == {"a"}
    record.put("b", killed=False)
    assert set(Record(path).found) == {"a", "b"}
