"""Group bits: how much time 16 bits in place of 32 could save where ``tsar`` moves colours and variances.

The planes that are safe in 16 bits are the three colours, the variance from change, the inverse number of samples and
the roughness (``scripts/precision.py``). They are moved as a cycle moves them, but without the conversion from and to
float32, so what is measured is the most that could be gained.
"""

from __future__ import annotations

import ctypes
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import torch
from jaxtyping import Int32
from torch import Tensor

from analysis.bench.native_code import compiled
from analysis.bench.options import BenchOptions
from analysis.bench.rows import Row, rate_row
from analysis.command.timing import take_turns

if TYPE_CHECKING:
    from analysis.command.progress import Bars

PLANES = 6
_CODE = Path(__file__).parent / "native" / "moved_planes.c"
_ZOOM = 0.98
_LEAST_TURNS = 31


def bits(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Planes of 16 bits beside planes of 32, in CPU seconds of one thread; no row without a C compiler."""
    if not shutil.which("cc"):
        return
    side, turns = options.resolution_px, max(options.repetitions, _LEAST_TURNS)
    task = bars.task("bits", turns)
    planes = {str(bits): Moved(side, bits, options.isa) for bits in (16, 32)}
    seconds = take_turns(planes, turns, task, clock=time.thread_time)
    row = Row("bits", f"{PLANES} planes of {side}² moved, 16 bits", "M pixels/s", 0.0, "32 bits")
    yield rate_row(row, side * side / 1e6, seconds["16"], seconds["32"])


class Moved:
    """Random planes with elements of 16 or 32 bits; a call moves them, as for a camera that comes 2 % closer.

    Attributes:
        source: the pixel from which each pixel takes its values.
        origin, to: planes before, and planes that a call writes.
    """

    def __init__(self, side: int, bits: int, isa: str = "native") -> None:
        kind, self.source = {16: torch.int16, 32: torch.int32}[bits], closer(side)
        values = torch.randint(1 << 14, (PLANES, side * side), generator=torch.Generator().manual_seed(0))
        self.origin, self.to = values.to(kind), torch.empty(PLANES, side * side, dtype=kind)
        self._function = getattr(compiled(_CODE, isa), f"moved{bits}")
        at = [ctypes.c_void_p(plane.data_ptr()) for plane in (self.source, self.origin, self.to)]
        self._arguments = ctypes.c_long(side * side), ctypes.c_long(PLANES), *at

    def __call__(self) -> None:
        self._function(*self._arguments)


def closer(side: int) -> Int32[Tensor, " pixels"]:
    """The pixel from which each takes its values when the picture grows by 2 % around its middle."""
    at = ((torch.arange(side) + 0.5 - 0.5 * side) * _ZOOM + 0.5 * side).to(torch.int32)
    return (at[:, None] * side + at).reshape(-1).contiguous()
