"""The figures by commit: what is counted, and that every case runs."""

import json
from pathlib import Path

import pytest

from analysis.bench.history import small

ROOT = Path(__file__).resolve().parents[3]
PERF = """#!/bin/sh
calls=$(echo "$*" | sed -n 's/^for _ in range(\\([0-9]*\\)):$/\\1/p')
echo "$((1000000 + 70 * ${calls:-0})),,instructions:u,1000,100.00,," >&2
"""


def test_instructions_of_one_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a stand-in for perf that counts a million for the start and 70 a call."""
    (tmp_path / "perf").write_text(PERF)
    (tmp_path / "perf").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    case = small.Instructions()
    case.setup("batch")
    for name in small.Instructions.params:
        assert case.track_call(name) == 70.0


def test_no_counter_leaves_the_figure_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(NotImplementedError, match="not available"):
        small.counted("<not supported>,,instructions:u,0,100.00,,\n")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(NotImplementedError, match="perf is not installed"):
        small.Instructions().setup("batch")


@pytest.mark.parametrize("name", ["batch", "conversion"])
def test_cases_run(name: str) -> None:
    exec(small._CASES[name].format(count=1), {})


def test_asv_finds_the_cases() -> None:
    config = json.loads((ROOT / "asv.conf.json").read_text())
    assert (ROOT / config["benchmark_dir"] / "small.py").is_file()
