"""C files of the benchmark, compiled by the system's compiler for the instruction set that is measured."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from functools import cache
from pathlib import Path

_TARGETS = {"native": "-march=native", "avx2": "-march=haswell", "avx512": "-march=skylake-avx512"}


@cache
def compiled(source: Path, isa: str) -> ctypes.CDLL:
    """The functions of a C file. The caller has made sure that there is a compiler, ``cc``."""
    with tempfile.TemporaryDirectory(prefix="tsar-bench-") as folder:
        made = Path(folder) / "functions.so"
        command = ["cc", "-O3", _TARGETS[isa], "-shared", "-fPIC", "-std=c11", "-o", str(made), str(source)]
        subprocess.run(command, check=True, capture_output=True)
        return ctypes.CDLL(str(made))
