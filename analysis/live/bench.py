"""How many cycles a second live views reach: a drive that is always the same, without a page."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import replace

import psutil

from analysis.command.cli import InputError, bad_input
from analysis.command.console import Table
from analysis.live.engine import Engine
from analysis.live.options import NOTHING, LiveOptions
from tsar.memory import core_count

SIZES = (256, 512, 1024)
"""Sides of the pictures."""
_TURN, _AHEAD = 0.2, 0.1  # radians, and distances to what is looked at, a second


@dataclasses.dataclass(frozen=True)
class Rate:
    """What one run of a drive reached.

    Attributes:
        resolution_px: side of its pictures.
        policy: its name.
        beside: name of the run that shared the machine; empty where none did.
        cycles: that ended.
        wall_s: seconds in which they did.
        own_s: of these, seconds in which this run worked.
        cpu_s: seconds of all cores of this process, others' runs included.
        error: why it stopped; empty where it did not.
    """

    resolution_px: int
    policy: str
    beside: str
    cycles: int
    wall_s: float
    own_s: float
    cpu_s: float
    error: str = ""


def cycle_rates(options: LiveOptions) -> list[Table | str]:
    """Drives through the scene at every size, each policy alone and both together; what they reached, as a table.

    Raises:
        InputError: the scene cannot be had, or no side has a policy.
    """
    names = options.controls.sides
    if not names:
        raise InputError("left, right: expected a policy to measure, got none on both sides")
    pairs = [(name, NOTHING) for name in names] + ([names] if len(names) == 2 else [])
    found = [rate for side in SIZES for pair in pairs for rate in driven(options, side, pair)]
    header = ("side, px", "policy", "beside", "cycles/s", "own ms a cycle", "CPU ms a cycle", "cores used")
    rows = [_row(one) for one in found]
    load, batch = psutil.getloadavg()[0], options.controls.batch_size
    said = f"{core_count()} cores, load of the machine at the end {load:.1f}; batch {batch}, {options.input}"
    return [Table("cycle rates of the live view", header, rows, words=3), said]


def _row(one: Rate) -> tuple[str, ...]:
    if one.error:
        return str(one.resolution_px), one.policy, one.beside or "–", f"failed: {one.error}", "–", "–", "–"
    cpu_ms = "–" if one.beside else f"{1e3 * one.cpu_s / max(one.cycles, 1):.1f}"
    pace = f"{one.cycles / one.wall_s:.1f}", f"{1e3 * one.own_s / max(one.cycles, 1):.1f}"
    return str(one.resolution_px), one.policy, one.beside or "–", *pace, cpu_ms, f"{one.cpu_s / one.wall_s:.2f}"


def driven(options: LiveOptions, resolution_px: int, pair: tuple[str, ...]) -> list[Rate]:
    """A drive of so many seconds after both have shown a picture."""
    controls = replace(options.controls, resolution_px=resolution_px, left=pair[0], right=pair[1])
    with bad_input():
        engine = Engine(replace(options, controls=controls))
    try:
        engine.wake()
        runs = [run for run in engine.look().runs.values() if run is not None]
        while any(run.cycles < 2 and not run.error for run in runs):
            time.sleep(0.01)
        speed = (0.0, 0.0, _AHEAD * engine.distance)
        engine.timeline.change(lambda drive: replace(drive, velocity=speed, turning=(_TURN, 0.0)))
        before, cpu_s, began = [(run.cycles, run.busy_s) for run in runs], time.process_time(), time.perf_counter()
        time.sleep(options.bench_seconds)
        after = [(run.cycles, run.busy_s) for run in runs]
        wall_s, cpu_s = time.perf_counter() - began, time.process_time() - cpu_s
    finally:
        engine.close()
    names = [run.name for run in runs]
    return [
        Rate(
            resolution_px,
            name,
            next((one for one in names if one != name), ""),
            b[0] - a[0],
            wall_s,
            b[1] - a[1],
            cpu_s,
            run.error,
        )
        for run, name, a, b in zip(runs, names, before, after, strict=True)
    ]
