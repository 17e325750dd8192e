"""Where kernels run: the only file that initialises Warp or picks a device."""

from __future__ import annotations

import contextlib
import ctypes.util
import os
import sys
import threading
from collections.abc import Callable, Iterator
from types import ModuleType

import torch
import warp as wp

DEVICES = ("cpu", "cuda:0")

_SLOW_LOAD_S = 0.4
_WARNINGS_ONLY = 30
_loaded: set[tuple[str, str]] = set()
_lock = threading.Lock()


class DeviceError(ValueError):
    """The device asked for cannot be used here."""


@contextlib.contextmanager
def _quiet_stderr() -> Iterator[None]:
    """Hides what native code writes to standard error."""
    sys.stderr.flush()
    kept = os.dup(2)
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(sink, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(sink)


def initialise() -> None:
    """Starts Warp, silently and without code for gradients; does nothing the second time."""
    wp.config.quiet = True
    wp.config.log_level = _WARNINGS_ONLY
    wp.config.enable_backward = False
    # Without a CUDA driver Warp warns on every start; that is no fault here, and asking for CUDA reports it anyway.
    with contextlib.nullcontext() if ctypes.util.find_library("cuda") else _quiet_stderr():
        wp.init()


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
    if device != "cpu" and not (wp.is_cuda_available() and torch.cuda.is_available()):
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


# on import: declaring the first record or kernel would otherwise start Warp with its defaults
initialise()
