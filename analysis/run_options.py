"""Options of one comparison of the adaptive renderer with the framed one."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from analysis.cost_model import CAPACITY_DEFAULT, CostParameters, Ledger, parameters_of
from tsar.config import StagesName, TsarConfig, closed_choices, require


@dataclass(frozen=True)
@closed_choices()
class RunOptions:
    """One comparison of the adaptive renderer with the framed one at equal cost."""

    input: Annotated[str, tyro.conf.Positional]
    """Built-in input (by name or number), or a scene file of PBRT v3, LuxRender 1.x or Mitsuba 0.5."""
    tsar: Annotated[TsarConfig, tyro.conf.arg(name=""), tyro.conf.OmitArgPrefixes] = field(default_factory=TsarConfig)
    """The adaptive pipeline."""
    seconds: float = 2.0
    """Simulated time to measure, seconds."""
    start_s: float = 0.0
    """Where in the animation the measurement starts, seconds."""
    phase: float = 0.0
    """Phase of the animation, for repetitions."""
    camera_path: Literal["", "turntable", "fly-through"] = ""
    """Motion of the camera of a scene file that has none."""
    clock: Literal["simulated", "wall"] = "simulated"
    """Simulated time by the cost model, or measured time (the same as the ledger wall)."""
    ledger: Ledger = "thesis"
    """How cost is counted."""
    capacity: float = CAPACITY_DEFAULT
    """Speed of the simulated machine, FLOP/s. The default shows 8 framed images a second at 512²."""
    trace_segments: float = 4.0
    """Ray segments per sample in the cost model; the thesis' inputs have about 4, its table says 5."""
    framed_samples_per_axis: int = 1
    """Samples along a pixel's side of the framed renderer; it shows fewer images as it takes more."""
    supersampled_samples_per_axis: int = 2
    """The same for a second, supersampled framed renderer at equal cost; 0 leaves it out."""
    reference_rate_hz: float = 60.0
    """Reference images per simulated second."""
    reference_samples_per_axis: int = 3
    """Samples along a pixel's side of the reference."""
    device: Literal["cpu", "cuda:0"] = "cpu"
    """Where rays are traced."""
    threads: int = 0
    """Threads for tracing; 0 takes one per core."""
    stages: StagesName = "compiled"
    """What runs the stages around tracing: kernels, or the tensor operations that they are checked against."""
    frames: bool = False
    """Also write what the adaptive display shows at every reference time to frames/, as EXR."""
    film: bool = True
    """Write comparison.mp4."""
    out: Path = Path("out/run")
    """Folder for the results."""
    cache: Path = Path(".cache/reference")
    """Folder for references, shared by all runs."""

    def __post_init__(self) -> None:
        for name in ("seconds", "capacity", "trace_segments", "reference_rate_hz"):
            value = getattr(self, name)
            require(0 < value < math.inf, name, "a positive, finite number", value)
        for name in ("start_s", "phase"):
            require(math.isfinite(getattr(self, name)), name, "a finite number", getattr(self, name))
        for name in ("framed_samples_per_axis", "reference_samples_per_axis"):
            require(1 <= getattr(self, name) <= 16, name, "between 1 and 16", getattr(self, name))
        for name in ("framed_samples_per_axis", "supersampled_samples_per_axis"):
            value = getattr(self, name)
            require(0 <= value <= 16 and value & (value - 1) == 0, name, "a power of two up to 16", value)
        require(self.threads >= 0, "threads", "at least 0", self.threads)
        require(
            self.tsar.warmup_cycles >= 4, "warmup_cycles", "at least 4 (the latency and one)", self.tsar.warmup_cycles
        )

    @property
    def counted(self) -> Ledger:
        """The ledger in force."""
        return "wall" if self.clock == "wall" else self.ledger

    @property
    def cost(self) -> CostParameters:
        """Parameters of the cost model for this run."""
        return parameters_of(self.tsar, self.trace_segments)

    @property
    def framed(self) -> dict[str, int]:
        """Framed renderers by name and their samples along a pixel's side; the first is the one compared to."""
        runs = {"framed": self.framed_samples_per_axis}
        if self.supersampled_samples_per_axis > 0:
            runs["framed supersampled"] = self.supersampled_samples_per_axis
        return runs
