"""Compiled kernels are kept by their content: no checkout, and no second process, compiles them again."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from renderer.compute.native_code import texts

ROOT = Path(__file__).resolve().parents[3]
NATIVE = {
    "renderer.compute.team_kernels": "team.h",
    "renderer.kernels.packets": "samples.h",
    "renderer.stages.kernels": "selection.h",
    "renderer.stages.picture_kernels": "gains.h",
    "renderer.stages.filtering_kernels": "shadows.h",
    "renderer.stages.reconstruction_kernels": "ages.h",
}
"""Modules with C++ of their own, and a header that is included by no other module."""
IDENTIFY = """
import importlib
import sys
from pathlib import Path

import warp as wp
from warp._src import build

compiled, compile_one = [], build.build_cpu
build.build_cpu = lambda *given, **named: (compiled.append(given[0]), compile_one(*given, **named))[1]

import renderer
from renderer.compute import device
from renderer.kernels import entry, guides
from renderer.layout.features import ALL

assert Path(renderer.__file__).is_relative_to(Path.cwd()), renderer.__file__
made = [importlib.import_module(name) for name in sys.argv[1:]]
device.load_kernels(made[0], "cpu", lambda line: None)
others = [entry, entry.specialised(ALL).module, guides.guides(ALL).module]
for module in [*made, *others]:
    own = module if isinstance(module, wp.Module) else wp.get_module(module.__name__)
    print(own.name, own.get_module_identifier())
print("compiled", len(compiled))
"""
RACE = """
import sys

from warp._src import build

compiled, compile_one = [], build.build_cpu
build.build_cpu = lambda *given, **named: (compiled.append(given[0]), compile_one(*given, **named))[1]

from renderer.compute import device
import small

print("ready", flush=True)
sys.stdin.readline()
device.load_kernels(small, "cpu", lambda line: None)
print("compiled", len(compiled))
"""
SMALL = """
import warp as wp

@wp.kernel(enable_backward=False)
def count(out: wp.array(dtype=float)):
    out[wp.tid()] = float(wp.tid())
"""


def checkout(folder: Path) -> Path:
    for package in ("renderer", "tsar"):
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def identified(folder: Path, cache: Path) -> dict[str, str]:
    """Names under which each module of a checkout is cached, and the number of modules compiled for one load."""
    environment = {**os.environ, "WARP_CACHE_PATH": str(cache), "PYTHONPATH": str(folder)}
    command = [sys.executable, "-c", IDENTIFY, *NATIVE]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=folder, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    return dict(line.split() for line in done.stdout.splitlines())


def test_a_second_checkout_compiles_nothing_but_what_changed(tmp_path: Path) -> None:
    cache, elsewhere = tmp_path / "cache", checkout(tmp_path / "elsewhere" / "second")
    first, second = identified(checkout(tmp_path / "first"), cache), identified(elsewhere, cache)
    assert first.pop("compiled") == "1" and second.pop("compiled") == "0"
    assert first == second and len(first) == len(NATIVE) + 3
    changed = {"renderer.compute.team_kernels", "renderer.kernels.packets"}
    for module in changed:
        (header,) = elsewhere.glob(f"renderer/*/native/{NATIVE[module]}")
        header.write_text(header.read_text() + "// changed\n")
    third = identified(elsewhere, cache)
    assert third.pop("compiled") == "1"
    assert {name for name in first if first[name] != third[name]} == changed


def test_of_two_processes_one_compiles(tmp_path: Path) -> None:
    (tmp_path / "small.py").write_text(SMALL)
    environment = {**os.environ, "WARP_CACHE_PATH": str(tmp_path / "cache"), "PYTHONPATH": f"{ROOT}:{tmp_path}"}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    both = [subprocess.Popen([sys.executable, "-c", RACE], env=environment, **pipes) for _ in range(2)]
    for one in both:
        assert one.stdout and one.stdout.readline() == "ready\n"
    for one in both:
        assert one.stdin
        one.stdin.write("\n")
        one.stdin.flush()
    printed = "".join(one.communicate(timeout=300)[0] for one in both)
    assert sorted(re.findall(r"compiled \d", printed)) == ["compiled 0", "compiled 1"]
    assert not list(tmp_path.rglob("*.lock"))


def test_a_cache_that_was_removed_is_made_again(tmp_path: Path) -> None:
    (tmp_path / "small.py").write_text(SMALL)
    environment = {**os.environ, "WARP_CACHE_PATH": str(tmp_path / "cache"), "PYTHONPATH": f"{ROOT}:{tmp_path}"}
    removed = RACE.replace("sys.stdin.readline()", "import shutil, warp; shutil.rmtree(warp.config.kernel_cache_dir)")
    done = subprocess.run([sys.executable, "-c", removed], env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and "compiled 1" in done.stdout, done.stderr


def test_headers_come_once_after_what_they_include() -> None:
    found = list(texts("shading.h", "surface.h", "samples.h"))
    names = [re.findall(r'^#line 1 "renderer/\w+/native/(\w+\.h)"', text)[0] for text in found]
    assert len(set(names)) == len(names) and names[-1] == "samples.h"
    for include, by in (("lanes.h", "functions.h"), ("surface.h", "shading.h"), ("quadtree.h", "samples.h")):
        assert names.index(include) < names.index(by)
    for name, text in zip(names, found, strict=True):
        (header,) = ROOT.glob(f"renderer/*/native/{name}")
        assert len(text.splitlines()) == len(header.read_text().splitlines()) + 1
        assert not re.search(r"^#(include|pragma once)", text, re.MULTILINE)
