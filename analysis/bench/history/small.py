"""What asv measures: CPU seconds of this thread, and instructions where the machine counts them.

The classes and names are those that asv asks for: ``setup``, ``time_…`` for seconds and ``track_…`` for other figures.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

_SIDE, _BATCH, _SUBDIVISIONS = 256, 32, 5
_CALLS = 2, 12
"""Numbers of calls whose instructions are subtracted, so that start and preparation do not count."""
_CODE = """from analysis.bench.history.small import {made} as Case
case = Case()
case.setup({given})
for _ in range({{count}}):
    case.{method}({given})
"""
_CASES = {
    "batch": _CODE.format(made="Batch", method="time_trace", given=""),
    "cycle of thesis": _CODE.format(made="Cycle", method="time_cycle", given="'thesis'"),
    "cycle of tsar": _CODE.format(made="Cycle", method="time_cycle", given="'tsar'"),
    "conversion": _CODE.format(made="Conversion", method="time_convert", given=""),
}


def instructions(code: str) -> int:
    """Instructions that a new Python executes for some code, in the user's part.

    Raises:
        NotImplementedError: there is no ``perf``, or the processor's counter is not available, as in many virtual
            machines; asv then leaves the figure out.
    """
    if shutil.which("perf") is None:
        raise NotImplementedError("perf is not installed")
    command = ["perf", "stat", "-x", ",", "-e", "instructions:u", sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=True)
    return counted(done.stderr)


def counted(told: str) -> int:
    """The count in the output of ``perf stat -x ,``.

    Raises:
        NotImplementedError: nothing was counted.
    """
    for line in told.splitlines():
        first, *others = line.split(",")
        if any(part.startswith("instructions") for part in others) and first.isdigit():
            return int(first)
    raise NotImplementedError("the processor's counter of instructions is not available")


class Timed:
    """Settings of asv that all share: five samples in one process, and time for kernels to be compiled."""

    timer = time.thread_time
    timeout = 900.0
    rounds = 1
    repeat = 5
    warmup_time = 0.0


class Batch(Timed):
    """Tracing one batch of framelets of the bumpy sphere, on one thread."""

    def setup(self) -> None:
        """Prepares the renderer."""
        from analysis.bench.options import BenchOptions
        from analysis.bench.scenes import bumpy_scene, morton_batches
        from renderer.trace import Renderer

        options = BenchOptions(resolution_px=_SIDE, batch_size=_BATCH)
        self._renderer = Renderer(bumpy_scene(_SUBDIVISIONS), threads=1, footprint_resolution_px=_SIDE)
        self._batch = morton_batches(options, 0.0)[0]
        self.time_trace()

    def time_trace(self) -> None:
        """One batch."""
        self._renderer.trace(self._batch)


class Cycle(Timed):
    """One cycle of a policy past its warm-up: all stages but tracing, on one thread."""

    params = ("thesis", "tsar")
    param_names = ("policy",)

    def setup(self, policy: str) -> None:
        """Runs the warm-up."""
        from itertools import islice

        from analysis.bench.cycles import CYCLE_S, steady, synthetic_trace
        from renderer.stages.control import stages
        from tsar.clock import fixed_clock
        from tsar.config import TsarConfig
        from tsar.policies import POLICIES
        from tsar.policy import Setting, run

        config = steady(TsarConfig(batch_size=_BATCH, resolution_px=_SIDE))
        made = POLICIES[policy](Setting(config, lambda config: stages(config, threads=1)))
        self._cycles: Any = run(made, synthetic_trace, fixed_clock(CYCLE_S), 0.0, 1e9)
        for _ in islice(self._cycles, config.warmup_cycles):
            pass

    def time_cycle(self, policy: str) -> None:
        """One cycle."""
        next(self._cycles)


class Conversion(Timed):
    """Reading a Cornell box in PBRT's format and writing it in Mitsuba's."""

    def setup(self) -> None:
        """Finds the scene."""
        from scenes.loading import ASSETS

        self._source = ASSETS / "cornell-box" / "cornell-box.pbrt"
        self._folder = tempfile.TemporaryDirectory()

    def time_convert(self) -> None:
        """One scene."""
        from scenes.formats.conversion import load_scene_file, save_scene_file

        scene = load_scene_file(self._source)
        save_scene_file(scene, Path(self._folder.name) / "scene.xml")


class Instructions:
    """Instructions of one call of the others."""

    timeout = 900.0
    unit = "instructions"
    params = tuple(_CASES)
    param_names = ("case",)

    def setup(self, case: str) -> None:
        """Leaves the figure out where nothing is counted."""
        instructions("pass")

    def track_call(self, case: str) -> float:
        """The difference of many calls and few."""
        few, many = (instructions(_CASES[case].format(count=count)) for count in _CALLS)
        return (many - few) / (_CALLS[1] - _CALLS[0])


class Start:
    """What a new Python takes to import the renderer and the policies."""

    timeout = 900.0
    rounds = 1
    repeat = 3
    number = 1

    def timeraw_import(self) -> str:
        """Code that asv times in processes of its own."""
        return "import renderer.trace, renderer.stages.control, tsar.policies"
