"""The output when kernels are compiled for the first time, on every kind of processor."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
COMPILE = """
import importlib
import sys

import warp as wp

target, *names = sys.argv[1:]
wp.config.cpu_compiler_flags = wp.config.cpu_compiler_flags.replace("-march=native", target)
for name in names:
    wp.load_module(importlib.import_module(name), device="cpu")
if "renderer.kernels.entry" in names:
    from renderer.kernels import entry
    wp.load_module(entry.specialised(entry.ALL).module, device="cpu")
"""
TARGETS = {
    "this processor": "-march=native",
    "AVX2": "-target-cpu haswell",
    "SSE2": "",
}
"""Compiler options by the registers that they allow: 16 floats with AVX-512, 8 and 4."""


def compile_anew(cache: Path, target: str, *names: str) -> str:
    """Compiles modules with nothing in the cache, in a process of its own; all that it printed."""
    environment = {**os.environ, "WARP_CACHE_PATH": str(cache), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", COMPILE, TARGETS[target], *names]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=ROOT, timeout=500)
    assert done.returncode == 0, done.stderr[-2000:]
    assert list(cache.rglob("*.o")), "nothing was compiled"
    return done.stdout + done.stderr


def test_a_first_run_prints_nothing(tmp_path: Path) -> None:
    assert compile_anew(tmp_path, "AVX2", "renderer.stages.reconstruction_kernels") == ""


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_a_first_run_of_all_kernels_prints_nothing(target: str, tmp_path: Path) -> None:
    names = "stages.kernels stages.reconstruction_kernels compute.team_kernels kernels.packets kernels.entry"
    assert compile_anew(tmp_path, target, *(f"renderer.{name}" for name in names.split())) == ""
