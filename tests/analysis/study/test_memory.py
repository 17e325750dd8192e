"""The peak of a block's memory."""

from __future__ import annotations

from pathlib import Path

import psutil
import pytest
import torch

from analysis.study import memory
from analysis.study.memory import PeakMemory

LARGE, SMALL = 200_000_000, 10_000_000


def touched(count: int) -> None:
    torch.ones(count, dtype=torch.uint8).add_(1)


def test_a_peak_is_of_its_block_alone() -> None:
    with PeakMemory() as large:
        touched(LARGE)
    with PeakMemory() as small:
        touched(SMALL)
    assert large.grown > 0.9 * LARGE > small.grown + 0.5 * LARGE
    assert small.bytes <= large.bytes and small.grown >= 0


def test_a_system_without_files_of_processes_tells_the_peak_since_the_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "_STATUS", tmp_path / "status")
    monkeypatch.setattr(memory, "_FORGET", tmp_path / "none" / "clear_refs")
    with PeakMemory() as held:
        touched(SMALL)
    assert held.grown == held.bytes >= 0.9 * psutil.Process().memory_info().rss
    assert held.bytes < psutil.virtual_memory().total, "bytes, not a multiple of them"
    monkeypatch.setattr(memory.sys, "platform", "darwin")
    assert memory._peak() == held.bytes // 1024, "macOS counts bytes, Linux KiB"
