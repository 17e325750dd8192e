"""What the tests of the pipeline share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import torch


@pytest.fixture(autouse=True)
def one_torch_thread() -> Iterator[None]:
    """Tensors are small here: threads of torch cost more than they save, and on a busy machine wait for one another for
    most of the time. No result depends on their number, which has a test of its own."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
