"""The same bits on processors without the instructions of this one.

Torch, NumPy, BLAS and the C library are told not to use newer instructions, each in its own way, in a separate process;
kernels are compiled for other registers. Differences between makers of processors are not covered here.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scenes import catalog

ROOT = Path(__file__).resolve().parents[2]
NO_AVX = "-AVX,-AVX2,-FMA,-FMA4,-AVX512F,-AVX_Usable,-AVX2_Usable,-FMA_Usable"


def plain_paths() -> dict[str, str]:
    """Environment in which libraries use only instructions that every x86-64 processor has."""
    newer = " ".join(np._core._multiarray_umath.__cpu_dispatch__)  # type: ignore[attr-defined]
    return {
        "ATEN_CPU_CAPABILITY": "default",
        "NPY_DISABLE_CPU_FEATURES": newer,
        "OPENBLAS_CORETYPE": "Prescott",
        "GLIBC_TUNABLES": f"glibc.cpu.hwcaps={NO_AVX}",
    }


def printed_hashes(code: str, *arguments: str, **environment: str) -> dict[str, str]:
    """The JSON output of a process in which the libraries use other instructions."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code, *arguments],
        capture_output=True, text=True, cwd=ROOT, timeout=500,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


HASHED = """
import dataclasses, hashlib, json, sys
from collections.abc import Mapping
import numpy as np
import warp as wp

def hashes(value, path, found, seen):
    if dataclasses.is_dataclass(value):
        if id(value) not in seen:
            seen.add(id(value))
            for field in dataclasses.fields(value):
                hashes(getattr(value, field.name), f"{path}.{field.name}", found, seen)
    elif isinstance(value, Mapping):
        for key in value:
            hashes(value[key], f"{path}[{key}]", found, seen)
    elif isinstance(value, tuple | list) and any(dataclasses.is_dataclass(part) for part in value):
        for number, part in enumerate(value):
            hashes(part, f"{path}[{number}]", found, seen)
    elif isinstance(value, wp.array):
        hashes(value.numpy(), path, found, seen)
    elif hasattr(value, "_cls"):
        for name in value._cls.vars:
            hashes(getattr(value, name), f"{path}.{name}", found, seen)
    elif value is not None:
        array = np.ascontiguousarray(value)
        found[path] = hashlib.sha256(repr(array.tolist()).encode() if array.dtype == object else array).hexdigest()
"""
SCENES = (
    HASHED
    + """
from renderer.tables.buffers import build_buffers
from scenes import catalog

found = {}
for name in sys.argv[1:]:
    scene = catalog.load(name)
    hashes(scene, name, found, set())
    hashes(build_buffers(scene, "cpu", "bvh").data, f"{name} as tables", found, set())
print(json.dumps(found))
"""
)


def differing(first: dict[str, str], second: dict[str, str]) -> list[str]:
    assert first.keys() == second.keys()
    return [name for name in first if first[name] != second[name]]


@pytest.mark.slow
def test_all_scenes_and_tables_are_built_of_the_same_bits() -> None:
    names = catalog.SCENES.names()
    native = printed_hashes(SCENES, *names)
    assert len(native) > 4000 and differing(native, printed_hashes(SCENES, *names, **plain_paths())) == []


OTHERS = (
    HASHED
    + """
import torch
from scenes.canonical import SunSky
from scenes.daylight import sky_map, sun_light
from scenes.loading import decode_srgb
from scenes.models import read_model
from renderer.sampling import plan as sampling
from renderer.film.files import encode_srgb
from renderer.tables.materials import mip_levels
from renderer.sampling import POINT_SETS
from renderer.sampling.point_sets import point_set

found = {}
rng = np.random.default_rng(0)
picture = rng.random((61, 97, 3)).astype(np.float32)
daylight = SunSky((0.3, 0.2, 0.5), 4.0)
hashes([sky_map(daylight, 32), sun_light(daylight)], "daylight", found, set())
hashes(decode_srgb(np.arange(256, dtype=np.uint8)), "decoded", found, set())
hashes(encode_srgb(torch.as_tensor(picture)), "encoded", found, set())
for number, level in enumerate(mip_levels(picture)):
    hashes(level, f"mip level {number}", found, set())
hashes(np.array(sampling.gaussian_warp(*rng.random((2, 4000)), 0.4)), "warp", found, set())
for name in POINT_SETS:
    hashes(point_set(name, 64, 3), f"points {name}", found, set())
print(json.dumps(found))
"""
)


def test_a_scene_its_tables_daylight_points_and_pictures_are_of_the_same_bits() -> None:
    code = SCENES.replace("print(json.dumps(found))\n", "") + OTHERS.replace(HASHED, "").replace("found = {}\n", "")
    native = printed_hashes(code, "fly-by")
    assert len(native) > 400 and differing(native, printed_hashes(code, "fly-by", **plain_paths())) == []


PIPELINE = (
    HASHED
    + """
from renderer.stages.control import compiled_stages
from renderer.trace import Renderer
from scenes import catalog
from tests.oracles.runs import play
from tsar.clock import fixed_clock
from tsar.config import TsarConfig
from tsar.stages import REFERENCE

renderer = Renderer(catalog.load("moving-camera"), threads=1)
config = TsarConfig(batch_size=32, resolution_px=64, warmup_cycles=2)
found = {}

def shown(name, displays):
    for number, (record, display) in enumerate(displays):
        hashes(display.image.numpy(), f"{name} image {number}", found, set())
        if record is not None:
            hashes([part.numpy() for part in (record.densities.spatial, record.densities.temporal)],
                   f"{name} densities {number}", found, set())

for name, stages in (("compiled", compiled_stages(config)), ("reference", REFERENCE)):
    shown(name, play("thesis", config, renderer.trace, fixed_clock(0.02), 0.0, 0.2, stages))
for name in ("afr", "frameless"):
    shown(name, play(name, config, renderer.trace, fixed_clock(0.02), 0.0, 0.06))
print(json.dumps(found))
"""
)
FILTER = (
    HASHED
    + """
import renderer.compute.device
if sys.argv[1:]:  # nothing for SSE2
    wp.config.cpu_compiler_flags = wp.config.cpu_compiler_flags.replace("-march=native", sys.argv[1])
from renderer.stages.control import compiled_stages
from renderer.trace import Renderer
from scenes import catalog
from tsar.config import TsarConfig
from tsar.policies.filter import Filter
from tsar.policy import Moment, Setting, step
from tsar.stages import REFERENCE

renderer = Renderer(catalog.load("moving-camera"), threads=1)
config = TsarConfig(batch_size=16, resolution_px=64)
found = {}
for name, stages in (("compiled", compiled_stages(config, threads=2)), ("reference", REFERENCE)):
    policy = Filter(Setting(config, lambda config: stages, view=renderer.viewpoint))
    state = policy.start()
    for cycle in range(24):
        state = step(policy, state, renderer.trace, Moment(cycle / 100, cycle, 1 / 100)).after
        if cycle % 4 == 3:
            for part in ("estimates", "surfels", "change", "shown", "remaining"):
                hashes(getattr(state, part), f"{name} {cycle} {part}", found, set())
print(json.dumps(found))
"""
)


def test_runs_are_of_the_same_bits() -> None:
    native = printed_hashes(PIPELINE)
    assert len(native) > 40 and len(set(native.values())) > 40
    assert differing(native, printed_hashes(PIPELINE, **plain_paths())) == []


def test_the_filter_runs_with_the_same_bits() -> None:
    native = printed_hashes(FILTER)
    compiled = {name: value for name, value in native.items() if name.startswith("compiled")}
    assert len(compiled) > 60 and len(set(compiled.values())) > 40
    assert list(compiled.values()) == [value for name, value in native.items() if name.startswith("reference")]
    assert differing(native, printed_hashes(FILTER, **plain_paths())) == []


TARGETS = {"AVX2": "-target-cpu haswell", "SSE2": ""}
FRAMES = (
    HASHED
    + """
import renderer.compute.device
target, *names = sys.argv[1:]
wp.config.cpu_compiler_flags = wp.config.cpu_compiler_flags.replace("-march=native", target)
from renderer.trace import Renderer
from scenes import catalog

found = {}
for name in names:
    for packets in (True, False):
        frame = Renderer(catalog.load(name), packets=packets).render_frame(0.3, 64, 64)
        hashes(frame.numpy(), f"{name} {packets}", found, set())
print(json.dumps(found))
"""
)


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_kernels_for_narrower_registers_give_the_same_bits(target: str, tmp_path: Path) -> None:
    names = "fly-by", "glass", "quad-light", "height-field"
    other = printed_hashes(FRAMES, TARGETS[target], *names, WARP_CACHE_PATH=str(tmp_path))
    assert list(tmp_path.rglob("*.o")), "nothing was compiled"
    assert differing(printed_hashes(FRAMES, "-march=native", *names), other) == []


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_the_filter_compiled_for_narrower_registers_gives_the_same_bits(target: str, tmp_path: Path) -> None:
    other = printed_hashes(FILTER, TARGETS[target], WARP_CACHE_PATH=str(tmp_path))
    assert list(tmp_path.rglob("*.o")), "nothing was compiled"
    assert differing(printed_hashes(FILTER), other) == []
