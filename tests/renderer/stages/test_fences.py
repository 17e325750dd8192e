"""Native code stays within its arrays and reads no unwritten memory, over whole cycles of the pipeline."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from renderer.compute import memory
from renderer.stages import control
from renderer.stages import reconstruction as display
from tests.oracles import pictures, runs
from tests.renderer.stages.builders import CONFIGS, CYCLE_S
from tests.renderer.stages.fences import Fences, Replaced
from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.policies.thesis import State
from tsar.types import Densities, Errors, FrameletBatch

ROOT = Path(__file__).resolve().parents[3]
QUICK = "coarse field", "finer than pixels"
PLACES = {"before the end": (True, 0xFF), "after the start": (False, 0x00)}


def replay(config: TsarConfig, fences: Fences | None, cycles: int = 10) -> str:
    """A hash of all results of some cycles by the compiled stages, with non-finite samples in the last cycles."""
    if fences is not None:
        fence(fences)
    keep = fences.tensor if fences is not None else lambda values: values
    found, trace = hashlib.sha256(), pictures.tracer(pictures.textured_motion)
    stages, state = control.compiled_stages(config, threads=2), runs.made("thesis", config).start()
    if fences is not None:
        fences.around_cache(state.cache)
    for number in range(cycles):
        due = state.due.at(number * CYCLE_S, number, config)
        batch = FrameletBatch(keep(due.level), keep(due.index), due.position, due.time_s)
        color = trace(due).color.contiguous()
        if number >= cycles - 2:
            color[::3, :5] = torch.nan
        errors = stages.observe(batch, keep(color), state.cache, config, StageTimer()).errors
        errors = Errors(keep(errors.spatial), keep(errors.temporal))
        before = Densities(keep(state.densities.spatial), keep(state.densities.temporal), state.densities.surplus)
        after = stages.decide(before, errors, keep(state.due.history), config, StageTimer())
        shown = stages.reconstruct(state.cache, config, CYCLE_S)
        newest = keep(shown.sample_map.newest_s)
        account = stages.account(after.densities, errors, newest, config)
        state = State(after.densities, after.tiling, after.due, state.cache)
        parts = errors.spatial, errors.temporal, after.densities.spatial, after.densities.temporal, after.due.history
        for part in (*parts, after.tiling.level, after.due.selected, after.due.position, shown.image, newest):
            found.update(part.numpy().tobytes())
        found.update(repr((account, after.densities.surplus, shown.overdraw)).encode())
    return found.hexdigest()


def fence(fences: Fences) -> None:
    """Makes the stages allocate their arrays between fences from now on."""
    for module in (control, display, memory):
        module.torch = Replaced(torch, empty=fences.empty, zeros=fences.zeros)  # type: ignore[attr-defined]
    for module in (control, display):
        module.np = Replaced(module.np, zeros=fences.zero_array)  # type: ignore[attr-defined]
    kept = memory.Memory.keep
    memory.Memory.keep = lambda self, name, values, *rest: kept(self, name, fences.tensor(values), *rest)


def in_a_process(name: str, place: str) -> str:
    """Runs a configuration between fences, in a separate process that crashes if they are touched."""
    command = [sys.executable, "-X", "faulthandler", "-m", "tests.renderer.stages.test_fences", name, place]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300)
    assert done.returncode == 0, f"{name}, {place}: status {done.returncode}\n{done.stderr[-2000:]}"
    return done.stdout.strip()


def assert_keeps_to_its_arrays(name: str) -> None:
    plain = replay(CONFIGS[name], None)
    for place in PLACES:
        assert in_a_process(name, place) == plain, f"{name}, {place}: a result hangs on memory that nothing wrote"


@pytest.mark.parametrize("name", QUICK)
def test_native_code_keeps_to_its_arrays(name: str) -> None:
    assert_keeps_to_its_arrays(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in CONFIGS if name not in QUICK])
def test_native_code_keeps_to_its_arrays_in_every_configuration(name: str) -> None:
    assert_keeps_to_its_arrays(name)


@pytest.mark.parametrize("place", PLACES)
def test_fences_are_noticed(place: str) -> None:
    """Reading one byte too far ends the process."""
    offset = "+ made.nbytes" if PLACES[place][0] else "- 1"
    program = f"""
import ctypes, numpy as np
from tests.renderer.stages.fences import Fences
made = Fences(*{PLACES[place]}).array((3, 5), np.float32)
ctypes.string_at(made.ctypes.data, made.nbytes)
print("inside", flush=True)
ctypes.string_at(made.ctypes.data {offset}, 1)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT, timeout=60)
    assert done.stdout == "inside\n" and done.returncode < 0


if __name__ == "__main__":
    print(replay(CONFIGS[sys.argv[1]], Fences(*PLACES[sys.argv[2]])))
