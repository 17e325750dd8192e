"""The provenance of a result is correct, and unknown entries are null."""

from __future__ import annotations

import dataclasses
import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch

from analysis.storage import provenance as module
from analysis.storage.provenance import cpu_model, provenance
from analysis.storage.source import brought
from tsar.choices import SOLVERS
from tsar.response.transport import waterfill


def test_configuration_versions_and_machine_are_named() -> None:
    first, same, other = (provenance({"a": a, "b": 2}, seed=3) for a in (1, 1, 5))
    assert first["config_hash"] == same["config_hash"] != other["config_hash"] and first["seed"] == 3
    assert first["versions"]["torch"] == torch.__version__ and first["versions"]["numpy"] == np.__version__
    assert first["processor"] == cpu_model() and first["added"] == []


def test_where_results_are_written_decides_none() -> None:
    hashes = {provenance({"a": 1, "out": out, "references": Path(out)})["config_hash"] for out in ("x", "y")}
    assert hashes == {provenance({"a": 1})["config_hash"]}


def test_outside_a_checkout_no_commit_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)  # of another project, above the packages
    monkeypatch.setattr(module, "_ROOT", tmp_path / "site-packages")
    found = provenance({})
    assert found["commit"] is None and found["uncommitted_changes"] is None


def test_a_checkout_names_its_commit_and_without_git_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def git(*arguments: str) -> str:
        command = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b.c", *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    (tmp_path / "file").write_text("1")
    git("init", "-q")
    git("add", "file")
    git("commit", "-qm", "first")
    monkeypatch.setattr(module, "_ROOT", tmp_path)
    assert (provenance({})["commit"], provenance({})["uncommitted_changes"]) == (git("rev-parse", "HEAD"), False)
    (tmp_path / "file").write_text("2")
    assert provenance({})["uncommitted_changes"] is True
    monkeypatch.setenv("PATH", "")
    assert provenance({})["commit"] is None and provenance({})["uncommitted_changes"] is None


def test_the_processor_is_named_as_the_system_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = tmp_path / "cpuinfo"
    info.write_text("processor\t: 0\nmodel name\t: Quick CPU @ 3 GHz\nflags: none\n")
    monkeypatch.setattr(module, "_CPU_INFO", info)
    assert cpu_model() == "Quick CPU @ 3 GHz"
    monkeypatch.setattr(module, "_CPU_INFO", tmp_path / "missing")
    assert cpu_model()


def test_what_was_added_is_named_with_its_content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "brought_along.py"
    with SOLVERS.lent(mine="brought_along:solve", here=waterfill):
        file.write_text("solve = None")
        first = brought((SOLVERS, "waterfill"), (SOLVERS, "mine"))
        assert [dataclasses.astuple(one)[:5] for one in first] == [("solver", "mine", "brought_along", None, None)]
        file.write_text("solve = 1")
        assert first[0].content and brought((SOLVERS, "mine"))[0].content not in (None, first[0].content)
        assert brought((SOLVERS, "here"))[0].module == "tsar.response.transport"
    assert brought((SOLVERS, "waterfill")) == []
