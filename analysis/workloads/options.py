"""Options of the map of workloads."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from analysis.command import limits
from analysis.command.cluster import ClusterOptions
from analysis.command.options import REFERENCES, References, Unprefixed
from analysis.study.asked import require_distinct, require_inputs, require_named
from analysis.study.cases import SCALES
from analysis.study.inputs import INPUTS
from tsar.config import TsarConfig, closed_choices, require
from tsar.policies import POLICIES, RIVALS


@dataclass(frozen=True)
@closed_choices()
class WorkloadOptions:
    """The policy of least error, by the price of a sample, the speed of motion and the resolution. Runs that are on
    disk are not repeated."""

    inputs: tuple[str, ...] = INPUTS
    """Built-in inputs, or other scenes by their names."""
    policies: tuple[str, ...] = ("tsar", "thesis", "framed", *RIVALS)
    """Policies to compare; framed is always one of them."""
    sample_flops: tuple[float, ...] = (1e2, 1e3, 1e4, 1e5)
    """Prices of a sample, FLOPs; the machine keeps the framed renderer's rate at each price."""
    image_hz: tuple[float, ...] = (32.0, 8.0, 2.0)
    """Images a second of the framed renderer: the fewer they are, the more moves from one to the next."""
    sides_px: tuple[int, ...] = (512,)
    """Output sides at the thesis' own size, powers of two from 128 to 4096, and at least 64 pixels at the scale;
    batches have an eighth as many samples as there are pixels. The reference of sides above 1024 is as wide."""
    scale: Literal["thesis", "half", "quick"] = "quick"
    """Sizes of the runs: as in the suitability study."""
    repetitions: int = 1
    """Repetitions of each: repetition r has seed r and phase r / repetitions."""
    tsar: Unprefixed[TsarConfig] = field(default_factory=TsarConfig)
    """The pipeline of all runs; batch and resolution come from the side, the seed from the repetition."""
    markdown: bool = False
    """Print the tables as Markdown."""
    farm: Unprefixed[ClusterOptions] = field(default_factory=ClusterOptions)
    """Where the runs are computed."""
    out: Path = Path("out/workloads")
    """Folder for the results."""
    references: References = REFERENCES

    def __post_init__(self) -> None:
        require_inputs(self.inputs)
        require_named(self, policies=POLICIES)
        require_distinct(self, "inputs", "policies", "sample_flops", "image_hz", "sides_px")
        for name, (least, most) in {"sample_flops": (1.0, 1e9), "image_hz": (0.5, 1000.0)}.items():
            ok = all(least <= one <= most for one in getattr(self, name))
            require(ok, name, f"numbers between {least:g} and {most:g}", getattr(self, name))
        least = max(128, 64 * SCALES[self.scale].divisor)
        ok = all(least <= side <= 4096 and side & (side - 1) == 0 for side in self.sides_px)
        require(ok, "sides_px", f"powers of two from {least} to 4096 at scale {self.scale}", self.sides_px)
        limits.within(self, repetitions=limits.REPETITIONS)
