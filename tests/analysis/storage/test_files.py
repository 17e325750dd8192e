"""Files appear complete or not at all, and JSON files are valid JSON."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.command.ownership import own_folder, release_folders, writable_folder
from analysis.storage.files import atomic, plain, write_json


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_under_its_name_only_when_it_is_done(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "er" / "a.png"
    with atomic(target) as temporary:
        temporary.write_text("half")
        assert not target.exists() and temporary.parent == target.parent
        moved = temporary.stat().st_ino
        assert temporary.suffix == ".png", "writers choose the format by the ending"
    assert target.read_text() == "half" and names(target.parent) == ["a.png"]
    assert target.stat().st_ino == moved, "renamed, not copied: a copy could be seen half-way"


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_an_exception_leaves_the_old_file_and_nothing_else(tmp_path: Path, error: type[BaseException]) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(error), atomic(target) as temporary:
        temporary.write_text("new")
        raise error
    assert target.read_text() == "old" and names(tmp_path) == ["a.txt"]


def test_a_failed_first_write_leaves_an_empty_folder(tmp_path: Path) -> None:
    with pytest.raises(ValueError), atomic(tmp_path / "a.txt") as temporary:
        temporary.write_text("new")
        raise ValueError
    assert names(tmp_path) == []


def test_values_that_cannot_be_written_replace_nothing(tmp_path: Path) -> None:
    target = tmp_path / "a.json"
    write_json(target, {"a": 1})
    with pytest.raises(TypeError, match="plain: cannot write a object"):
        write_json(target, {"a": object()})
    assert json.loads(target.read_text()) == {"a": 1} and names(tmp_path) == ["a.json"]


@dataclass(frozen=True)
class Inner:
    place: Path
    values: tuple[float, ...]


@dataclass(frozen=True)
class Outer:
    inner: Inner
    array: np.ndarray


def test_plain_of_nested_values() -> None:
    value = Outer(Inner(Path("a/b"), (1.0, math.inf)), np.array([[1.5, math.nan], [-math.inf, 2.0]]))
    assert plain(value) == {
        "inner": {"place": "a/b", "values": [1.0, "inf"]},
        "array": [[1.5, None], ["-inf", 2.0]],
    }
    assert plain({3: np.float32(0.5), "n": np.int64(7), "yes": np.bool_(True)}) == {"3": 0.5, "n": 7, "yes": True}
    assert plain(np.float64("nan")) is None and plain(-math.inf) == "-inf"
    assert plain(None) is None and plain(True) is True


leaves = st.none() | st.booleans() | st.integers() | st.floats() | st.text()


@given(st.recursive(leaves, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=12))
def test_plain_values_survive_strict_json(value) -> None:
    """Everything is read back unchanged, except floats that JSON lacks."""

    def same(before, after) -> bool:
        if isinstance(before, float) and not math.isfinite(before):
            return after == (None if math.isnan(before) else str(before))
        if isinstance(before, list):
            return len(before) == len(after) and all(map(same, before, after))
        if isinstance(before, dict):
            return before.keys() == after.keys() and all(same(before[key], after[key]) for key in before)
        return type(before) is type(after) and before == after

    assert same(value, json.loads(json.dumps(plain(value), allow_nan=False)))


def test_writable_folder_is_made_and_left_clean(tmp_path: Path) -> None:
    folder = writable_folder(tmp_path / "a" / "b", "out")
    assert folder == tmp_path / "a" / "b" and names(folder) == []


@pytest.mark.parametrize("below", ["", "below"])
def test_a_file_in_place_of_a_folder_is_named(tmp_path: Path, below: str) -> None:
    (tmp_path / "taken").touch()
    with pytest.raises(ValueError, match=r"^out: cannot write to '.*taken.*' \(.+\)$"):
        writable_folder(tmp_path / "taken" / below, "out")


OWNER = """
import sys, time
from pathlib import Path
from analysis.command.cli import bad_input, run_cli
from analysis.command.ownership import own_folder
def main():
    with bad_input():
        own_folder(Path(sys.argv[1]), "out")
    print("mine", flush=True)
    sys.stdin.read()
run_cli(main)
"""


def test_a_folder_has_one_owner_at_a_time(tmp_path: Path) -> None:
    """The second is told who the first is; a killed one leaves nothing locked, one that ends leaves nothing at all."""
    root = Path(__file__).resolve().parents[3]
    command = [sys.executable, "-c", OWNER, str(tmp_path / "out")]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": root}
    with subprocess.Popen(command, **pipes) as first:
        assert first.stdout.readline() == "mine\n"
        second = subprocess.run(command, input="", capture_output=True, text=True, cwd=root)
        assert second.returncode == 2 and second.stderr.count("\n") == 1
        assert f"error: out: {tmp_path / 'out'} is in use by process {first.pid} on " in second.stderr
        first.kill()
    assert len(list((tmp_path / "out").iterdir())) == 1
    third = subprocess.run(command, input="", capture_output=True, text=True, cwd=root)
    assert third.returncode == 0 and third.stdout == "mine\n" and not list((tmp_path / "out").iterdir())


def test_a_process_owns_a_folder_as_often_as_it_likes(tmp_path: Path) -> None:
    try:
        assert own_folder(tmp_path, "out") == own_folder(tmp_path / "." / "", "out") == tmp_path
    finally:
        release_folders()
    assert not list(tmp_path.iterdir())
