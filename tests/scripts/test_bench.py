"""The benchmark's command line: a part of it run, files compared, bad input refused."""

import json
from pathlib import Path

import pytest

from tests.scripts.commands import assert_refused, call_script, nothing_in

SMALL = ("--resolution-px", "64", "--batch-size", "8", "--scenes", "fly-by", "--repetitions", "7")


def test_a_part_is_run_and_compared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    arguments = ("--only", "order,hits", "--only", "cores", *SMALL, "--out", str(tmp_path))
    assert call_script("bench.py", monkeypatch, *arguments) == 0
    shown = capsys.readouterr().out
    found = json.loads((tmp_path / "bench.json").read_text())
    rows = {(row["group"], row["name"]): row for row in found["rows"]}
    peers = {"Morton order": ("order", "row order"), "with first hits": ("hits", "without")}
    names = {
        (peers[what][0], f"{scene}, {what}"): peers[what][1] for scene in ("fly-by", "bumpy sphere") for what in peers
    }
    assert set(names) <= set(rows) and {group for group, _ in rows} <= {"order", "hits", "cores"}
    for key, peer in names.items():
        row = rows[key]
        assert row["peer_name"] == peer and row["met"] is None and row["repetitions"] == 7
        low, high = row["spread"]
        assert 0.0 < low <= row["ratio"] <= high
    assert found["machine"]["cpu"] in shown and "row order" in shown
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["rows"] == len(rows) and summary["config"]["only"] == ["order,hits", "cores"]
    assert set(summary["provenance"]) >= {"commit", "config_hash", "versions"}

    same = str(tmp_path / "bench.json")
    out = tmp_path / "unused"
    assert call_script("bench.py", monkeypatch, "--compare", same, same, "--out", str(out)) == 0
    assert "fly-by, Morton order" in capsys.readouterr().out and nothing_in(out)


def test_a_missing_gpu_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    import torch

    if torch.cuda.is_available():
        pytest.skip("there is one")
    arguments = ("--device", "cuda:0", "--only", "order", "--out", str(tmp_path))
    status = call_script("bench.py", monkeypatch, *arguments)
    assert_refused(status, capsys, ("cuda:0",))
    assert nothing_in(tmp_path)


@pytest.mark.parametrize("isa", ["avx2", "avx512"])
def test_an_instruction_set_that_a_group_or_the_processor_lacks_is_refused(
    isa: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    import torch

    status = call_script("bench.py", monkeypatch, "--isa", isa, "--only", "shaded", "--out", str(tmp_path))
    assert_refused(status, capsys, ("isa", "coherent, incoherent"))
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: "DEFAULT")
    status = call_script("bench.py", monkeypatch, "--isa", isa, "--only", "coherent", *SMALL, "--out", str(tmp_path))
    assert_refused(status, capsys, ("isa", "this processor has"))
    assert nothing_in(tmp_path)
