"""Where kernels run: the only file that initialises Warp or picks a device."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from types import ModuleType

import warp as wp

DEVICES = ("cpu", "cuda:0")

# Set on import: declaring the first record or kernel already starts Warp.
wp.config.quiet = True
wp.config.enable_backward = False

_SLOW_LOAD_S = 0.4
_initialised = False
_loaded: set[tuple[str, str]] = set()
_lock = threading.Lock()


class DeviceError(ValueError):
    """The device asked for cannot be used here."""


def initialise() -> None:
    """Starts Warp once."""
    global _initialised
    with _lock:
        if _initialised:
            return
        wp.init()
        _initialised = True


def pick(device: str) -> str:
    """Checks a device name and that the device is there.

    Args:
        device: one of :data:`DEVICES`.

    Returns:
        The name, to hand to Warp.

    Raises:
        DeviceError: if the name is unknown or the machine has no such device.
    """
    if device not in DEVICES:
        raise DeviceError(f"device: expected one of {', '.join(DEVICES)}, got {device!r}")
    initialise()
    if device != "cpu" and not wp.is_cuda_available():
        raise DeviceError(f"device {device!r}: no CUDA device is available on this machine, use 'cpu'")
    return device


def _report(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def load_kernels(module: ModuleType, device: str, report: Callable[[str], None] = _report) -> None:
    """Loads a module of kernels before its first launch, and says so when that takes a while.

    Compiling a module that is not in the cache takes seconds; loading a cached one takes milliseconds. Loading before
    the first launch also keeps worker threads from compiling the same module at once.

    Args:
        module: Python module that defines kernels.
        device: from :func:`pick`.
        report: called with one line of text if kernels have to be compiled.
    """
    key = (module.__name__, device)
    with _lock:
        if key in _loaded:
            return
        timer = threading.Timer(_SLOW_LOAD_S, report, (f"compiling kernels for {device}, once, takes some seconds…",))
        timer.start()
        try:
            wp.load_module(module, device=device)
        finally:
            timer.cancel()
        _loaded.add(key)


def core_count() -> int:
    """Number of CPU cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
