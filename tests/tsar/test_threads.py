"""Threads of torch: one where the stages have threads of their own, and all of them again afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
import torch

from tests.oracles import pictures
from tsar.clock import fixed_clock
from tsar.config import TsarConfig
from tsar.policies import POLICIES
from tsar.policy import Setting, run
from tsar.stages import reference
from tsar.threads import one_thread


@pytest.fixture
def threads() -> Iterator[None]:
    """Puts the number of threads back after the test, which sets it."""
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)


def test_one_thread_gives_the_others_back(threads: None) -> None:
    for before in (1, 2, 3):
        torch.set_num_threads(before)
        with one_thread():
            assert torch.get_num_threads() == 1
        assert torch.get_num_threads() == before
        with pytest.raises(KeyError), one_thread():
            raise KeyError
        assert torch.get_num_threads() == before


CASES = [("filter", True, 1), ("filter", False, 3), ("thesis", True, 1), ("afr", True, 3)]


@pytest.mark.parametrize(("name", "own", "expected"), CASES)
def test_stages_with_threads_of_their_own_leave_one_to_torch(
    name: str, own: bool, expected: int, threads: None
) -> None:
    config, seen = TsarConfig(resolution_px=128, batch_size=16, warmup_cycles=4), []
    answered = pictures.tracer(pictures.constant)

    def trace(batch):
        seen.append(torch.get_num_threads())
        return answered(batch)

    torch.set_num_threads(3)
    policy = POLICIES[name](Setting(config, lambda config: replace(reference(config), own_threads=own)))
    for _ in zip(run(policy, trace, fixed_clock(0.01), 0.0, 1.0), range(3), strict=False):
        assert torch.get_num_threads() == 3, "between cycles, torch has what it had"
    assert set(seen) == {expected}
