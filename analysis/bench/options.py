"""Options of the benchmark."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from analysis.command import limits
from analysis.study.asked import require_inputs
from tsar.config import closed_choices, require
from tsar.named import require_known

GROUPS = (
    "coherent",
    "incoherent",
    "shaded",
    "cores",
    "order",
    "hits",
    "features",
    "overhead",
    "tsar",
    "bits",
    "growth",
    "large",
    "conversion",
    "start",
)
"""Groups of rows, in the order of the table."""

ON_CPU_ONLY = ("coherent", "incoherent", "cores", "hits", "bits", "large", "conversion", "start")
"""Groups that do not run on a GPU."""

ON_ANY_ISA = ("coherent", "incoherent", "cores", "order", "hits", "overhead", "tsar", "bits", "growth", "large")
"""Groups in which our side, and Embree, can be limited to an instruction set."""

FRAMELET_SIDE = 16
_FEWEST_REPETITIONS = 7


@dataclass(frozen=True)
@closed_choices()
class BenchOptions:
    """The speed of the simulator beside its peers: rays, shaded samples, overhead, growth, start."""

    out: Path = Path("out/bench")
    """Folder for the results; bench.json, tables.md and summary.json; on a GPU bench-cuda.json and
    summary-cuda.json."""
    only: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """What to do, instead of everything; a group, or several with commas between; may be repeated. Without it all run:
    coherent, incoherent, shaded, cores, order, hits, features, overhead, tsar, bits, growth, large, conversion,
    start."""
    compare: tuple[Path, Path] | None = None
    """Two bench.json whose figures of our side are compared; nothing is run."""
    device: Literal["cpu", "cuda:0"] = "cpu"
    """Where rays are traced; peers stay on the CPU."""
    isa: Literal["native", "avx2", "avx512"] = "native"
    """Instruction set of our code and of Embree: native is this processor's. With another one, the groups run in which
    both can be limited."""
    repetitions: int = 9
    """Repetitions of each; turns of a case; the medians are reported."""
    resolution_px: int = 512
    """Width and height of the pictures, pixels, a power of two."""
    subdivisions: tuple[int, ...] = (4, 5, 6, 8)
    """Meshes of the groups coherent and incoherent, of 20 * 4^subdivisions triangles."""
    batch_size: int = 128
    """Framelets rendered per cycle."""
    cycles: int = 10_000
    """Cycles over which the group growth watches memory."""
    scenes: tuple[str, ...] = ()
    """Built-in scenes; all where none is named."""
    scene_files: tuple[Path, ...] = ()
    """Scene files that the group conversion converts; the delivered Cornell boxes where none is named."""
    scene_root: Path | None = None
    """Folder that the scene files may read from; by default their own."""

    def __post_init__(self) -> None:
        for name in self.groups:
            require_known(name, "only", GROUPS)
        require_inputs(self.scenes, "scenes")
        limited = self.isa == "native" or set(self.groups) <= set(ON_ANY_ISA)
        require(limited, "isa", f"native, or only groups of {', '.join(ON_ANY_ISA)}", self.isa)
        require(self.isa == "native" or self.device == "cpu", "isa", "native on a GPU", self.isa)
        least = _FEWEST_REPETITIONS
        limits.within(self, repetitions=(least, limits.REPETITIONS[1]), subdivisions=(0, 9), cycles=(100, 10**6))
        side = self.resolution_px
        require(64 <= side <= 4096 and side & (side - 1) == 0, "resolution_px", "a power of two in [64, 4096]", side)
        most = (side // FRAMELET_SIDE) ** 2
        require(1 <= self.batch_size <= most, "batch_size", f"between 1 and {most}, a picture's", self.batch_size)
        for file in self.scene_files:
            require(file.is_file(), "scene_files", "scene files that are there", file)

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups to run, in the order of the table."""
        every = GROUPS if self.isa == "native" else ON_ANY_ISA
        asked = [name.strip() for part in self.only for name in part.split(",")] or list(every)
        known = [name for name in GROUPS if name in asked]
        return tuple(known + [name for name in asked if name not in GROUPS])

    @property
    def file_ending(self) -> str:
        """Ending of the names of files that hold figures of a GPU; empty for the CPU."""
        return "" if self.device == "cpu" else "-cuda"
