"""Devices: the only module that initialises Warp or selects a device."""

from __future__ import annotations

import contextlib
import ctypes.util
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path
from types import ModuleType

import torch
import warp as wp

from tsar.memory import core_count

DEVICES = ("cpu", "cuda:0")
WARP_TESTED = "1.19"
"""Release of Warp with which this package was tested, in any patch version: launches use parts that are not its public
interface."""

_SLOW_LOAD_S = 0.4
_LINE_INTERVAL_S = 2.0
_STATUS_INTERVAL_S = 0.2
_WARNINGS_ONLY = 30
_loaded: set[tuple[str, str]] = set()
_expected: dict[str, list[Kernels]] = {}
_lock = threading.Lock()


class DeviceError(ValueError):
    """The requested device cannot be used here."""


class VersionError(ImportError):
    """A package is installed in an unsupported version."""


def require_tested(found: str) -> None:
    """Checks a version of Warp.

    Raises:
        VersionError: if it does not belong to the tested release.
    """
    if found.split(".")[:2] != WARP_TESTED.split("."):
        raise VersionError(f"warp-lang: expected version {WARP_TESTED}.x, which was tested, found {found}")


require_tested(wp.__version__)  # before any other part of it is used


@contextlib.contextmanager
def _quiet_stderr() -> Iterator[None]:
    """Hides the output of native code on standard error."""
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
    """Starts Warp silently and without code for gradients; further calls have no effect."""
    wp.config.quiet = True
    wp.config.log_level = _WARNINGS_ONLY
    wp.config.enable_backward = False
    # Without a CUDA driver Warp warns at every start. That is no error here, and a request for CUDA reports it anyway.
    with contextlib.nullcontext() if ctypes.util.find_library("cuda") else _quiet_stderr():
        wp.init()


INSTRUCTIONS = {"native": "-march=native", "avx2": "-target-cpu haswell", "avx512": "-target-cpu skylake-avx512"}
"""Compiler options by the instruction set of the kernels; ``native`` is this processor's."""


def use_instructions(isa: str) -> None:
    """Limits kernels that are loaded from now on to an instruction set of :data:`INSTRUCTIONS`.

    Raises:
        DeviceError: this processor does not have it.
    """
    had = torch.backends.cpu.get_cpu_capability()
    if (isa == "avx512" and had != "AVX512") or (isa == "avx2" and had not in ("AVX2", "AVX512")):
        raise DeviceError(f"isa: expected instructions that this processor has, got {isa!r}")
    options = wp.config.cpu_compiler_flags or ""
    for one in INSTRUCTIONS.values():
        options = options.replace(one, INSTRUCTIONS[isa])
    wp.config.cpu_compiler_flags = options


def pick(device: str) -> str:
    """Checks the name of a device and that the device exists.

    Args:
        device: one of :data:`DEVICES`.

    Returns:
        The name of the device for Warp.

    Raises:
        DeviceError: if the name is unknown or the machine has no such device.
    """
    if device not in DEVICES:
        raise DeviceError(f"device: expected one of {', '.join(DEVICES)}, got {device!r}")
    if device != "cpu" and not (wp.is_cuda_available() and torch.cuda.is_available()):
        raise DeviceError(f"device {device!r}: no CUDA device is available on this machine, use 'cpu'")
    return device


Kernels = ModuleType | wp.Module
"""A module of kernels: a Python module, or one that Warp created for a set of features."""


def load_kernels(
    modules: Kernels | Sequence[Kernels], device: str, report: Callable[[str], None] | None = None
) -> None:
    """Loads modules of kernels before their first launch, and reports progress if that takes a while.

    Compiling a module that is not in the cache takes seconds; loading a cached one takes milliseconds. Loading before
    the first launch also keeps worker threads from compiling the same module at once. Several modules are compiled in
    parallel: Warp holds its lock while it generates their source, but not while it compiles. Of several processes that
    need the same module for the CPU, one compiles it, and the others wait for it.

    Args:
        modules: modules to load.
        device: from :func:`pick`.
        report: called with a line of text from time to time during compilation; by default a status on a terminal, or
            lines on standard error.
    """
    with _lock:
        asked = [modules] if isinstance(modules, Kernels) else list(modules)
        asked += _expected.pop(device, [])
        missing = [module for module in dict.fromkeys(asked) if (_name(module), device) not in _loaded]
        if not missing:
            return
        with ThreadPoolExecutor(min(len(missing), core_count())) as pool:
            loads = {pool.submit(_load, module, device): _name(module) for module in missing}
            _watch(loads, device, report)
        for load, name in loads.items():
            load.result()
            _loaded.add((name, device))


def expect_kernels(modules: Sequence[Kernels], device: str) -> None:
    """Adds modules to those that :func:`load_kernels` loads next on a device: what a program needs anyway, but later,
    is then compiled beside the rest."""
    with _lock:
        _expected.setdefault(device, []).extend(modules)


def _load(module: Kernels, device: str) -> None:
    with _one_process(module) if device == "cpu" else contextlib.nullcontext():
        wp.load_module(module, device=device)


@contextlib.contextmanager
def _one_process(module: Kernels) -> Iterator[None]:
    """Holds the lock of a module that is not in the cache.

    Warp moves what it has compiled into the cache whole. So the lock saves work, and nothing depends on it.
    """
    made = module if isinstance(module, wp.Module) else wp.get_module(module.__name__)
    # launches on the CPU have blocks of one thread
    kept = Path(wp.config.kernel_cache_dir or "") / made.get_module_identifier(block_dim=1)
    if kept.is_dir():
        yield
        return
    from filelock import lock_descriptor  # here, because it takes long to import

    lock = kept.with_name(f"{kept.name}.lock")
    with contextlib.ExitStack() as held:
        with contextlib.suppress(OSError):  # such as a folder of another user
            lock.parent.mkdir(parents=True, exist_ok=True)
            held.callback(_removed, lock)  # after it was closed: Windows keeps a file that is open
            file = held.enter_context(lock.open("ab"))
            lock_descriptor(file.fileno())
        yield


def _removed(lock: Path) -> None:
    """Removes a lock, unless another process holds it on a system that then keeps it."""
    with contextlib.suppress(OSError):
        lock.unlink()


def _name(module: Kernels) -> str:
    return module.__name__ if isinstance(module, ModuleType) else module.name


def _watch(loads: Mapping[Future, str], device: str, report: Callable[[str], None] | None) -> None:
    """Waits until all loads have ended, and reports progress if that takes a while."""
    began = time.perf_counter()
    if not wait(loads, timeout=_SLOW_LOAD_S).not_done:
        return
    with _shown(report) as (show, interval_s):
        while under_way := [name for load, name in loads.items() if not load.done()]:
            done = f"{len(loads) - len(under_way)} of {len(loads)} modules ready"
            seconds = time.perf_counter() - began
            show(f"compiling kernels for {device}, once: {done}, {seconds:.0f} s, to come: {', '.join(under_way)}")
            wait([load for load in loads if not load.done()], interval_s, FIRST_COMPLETED)
        if not any(load.exception() for load in loads):
            show(f"kernels for {device} ready after {time.perf_counter() - began:.1f} s")


@contextlib.contextmanager
def _shown(report: Callable[[str], None] | None) -> Iterator[tuple[Callable[[str], object], float]]:
    """A function that shows a line of text, and the interval between lines, seconds."""
    if report is not None:
        yield report, _LINE_INTERVAL_S
    # a progress bar on the terminal replaces the stream, so that the condition is false
    elif sys.stderr is sys.__stderr__ and sys.stderr.isatty():
        from rich.console import Console
        from rich.text import Text

        with Console(stderr=True, markup=False, emoji=False).status("") as status:
            yield lambda line: status.update(Text(line)), _STATUS_INTERVAL_S
    else:
        yield lambda line: print(line, file=sys.stderr, flush=True), _LINE_INTERVAL_S


# on import: otherwise the declaration of the first record or kernel would start Warp with its defaults
initialise()
