"""The peak of a block's memory."""

from __future__ import annotations

import torch

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
