"""Options of the sensitivity study."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from analysis.command import limits
from analysis.command.cluster import ClusterOptions
from analysis.command.options import REFERENCES, References, Unprefixed
from analysis.metrics.cost_model import Ledger
from analysis.study.asked import require_distinct, require_inputs, require_rows
from analysis.study.cases import SCALES
from analysis.study.inputs import INPUTS
from tsar.config import TsarConfig, closed_choices, require


@dataclass(frozen=True)
@closed_choices()
class SensitivityOptions:
    """Runs over a grid of spatial and temporal slopes, and over offsets and bias. Runs on disk are not repeated."""

    inputs: tuple[str, ...] = INPUTS
    """Built-in inputs, or other scenes by their names."""
    row: int = 7
    """Row of table 7.2, 0 to 15; it gives batch and resolution, 7 is batch 128 at 512²."""
    scale: Literal["thesis", "half", "quick"] = "quick"
    """Sizes of the runs: thesis, its resolution and batch; half, half the side, and a quarter of samples, tiles and
    machine speed; quick, a quarter of the side, and half the rate of the reference."""
    spatial_slopes: tuple[float, ...] = (-2.0, -1.0, 0.0)
    """Spatial slopes of the grid, steepest first."""
    temporal_slopes: tuple[float, ...] = (-2.0, -1.0, 0.0)
    """Temporal slopes of the grid, steepest first."""
    offsets: tuple[float, ...] = (-4.0, -2.0, 0.0, 2.0, 4.0)
    """Values added to the spatial offset and, in separate runs, to the temporal one."""
    biases: tuple[float, ...] = (-2.0, -1.0, 0.0, 1.0, 2.0)
    """Biases, octaves; positive towards space."""
    repetitions: int = 1
    """Repetitions of each: repetition r has seed r and phase r / repetitions."""
    figure_input: str = "fast-crossing"
    """The input that is shown as pictures."""
    still_s: float = 0.65
    """Time of the pictures, seconds after the start."""
    tsar: Unprefixed[TsarConfig] = field(default_factory=TsarConfig)
    """The default setting, marked by an asterisk; batch and resolution come from the row, seed from the repetition."""
    ledger: Ledger = "thesis"
    """How cost is counted; wall is refused, because its results are not repeatable."""
    farm: Unprefixed[ClusterOptions] = field(default_factory=ClusterOptions)
    """Where the runs are computed."""
    out: Path = Path("out/sensitivity")
    """Folder for the results."""
    references: References = REFERENCES

    def __post_init__(self) -> None:
        require_inputs(self.inputs)
        require_distinct(self, "inputs", "spatial_slopes", "temporal_slopes")
        for name in ("offsets", "biases"):  # may be none
            chosen = getattr(self, name)
            require(len(chosen) == len(set(chosen)), name, "none twice", chosen)
        require_rows("row", [self.row])
        slopes, changes = (-60.0, 60.0), (-120.0, 120.0)
        limits.within(self, spatial_slopes=slopes, temporal_slopes=slopes, offsets=changes, biases=(-8.0, 8.0))
        limits.within(self, repetitions=limits.REPETITIONS)
        require(self.figure_input in self.inputs, "figure_input", "one of the inputs", self.figure_input)
        seconds = SCALES[self.scale].seconds
        require(0 <= self.still_s < seconds, "still_s", f"a time within the run's {seconds:g} s", self.still_s)
