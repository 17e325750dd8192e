"""Settings shared by all tests."""

import os
import signal
from collections.abc import Generator

import psutil
import pytest
from hypothesis import settings

from tests import shapes
from tsar.memory import core_count

# Tensors are small here: threads of torch cost more than they save, and on a busy machine wait for one another for most
# of the time. No result depends on their number, which has tests of its own. Processes that tests start inherit this.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# if a test asks for more threads, waiting ones leave their core to others
os.environ.setdefault("GOMP_SPINCOUNT", "1000")

settings.register_profile("tsar", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("tsar")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # as in a shell's background: tests of interrupts need what a process in front has
    signal.signal(signal.SIGINT, signal.default_int_handler)

WORKER_BYTES = 3 << 30
"""Memory of one process of tests with all that it starts, at most."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """As many processes as there are cores, and memory for."""
    return max(1, min(core_count(), psutil.virtual_memory().available // WORKER_BYTES))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol() -> Generator[None, object, object]:
    shapes.begin()
    return (yield)
