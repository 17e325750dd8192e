"""Options of the study of precision."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from analysis.command import limits
from analysis.command.cluster import ClusterOptions
from analysis.command.options import REFERENCES, References, Unprefixed
from analysis.study.asked import require_distinct, require_inputs, require_rows
from analysis.study.inputs import INPUTS
from tsar.config import TsarConfig, closed_choices


@dataclass(frozen=True)
@closed_choices()
class PrecisionOptions:
    """The values that a policy keeps from one stage to the next, and textures, in fewer bits. Runs that are on disk are
    not repeated."""

    inputs: tuple[str, ...] = INPUTS
    """Built-in inputs, or other scenes by their names."""
    policies: tuple[Literal["tsar", "thesis"], ...] = ("tsar", "thesis")
    """Policies to compare; each with itself."""
    kept: tuple[str, ...] = ()
    """Names of the kinds of values to change, each alone; all where none is named. An unknown name prints the list."""
    row: int = 7
    """Row of table 7.2, 0 to 15."""
    scale: Literal["thesis", "half", "quick"] = "quick"
    """Sizes of the runs: as in the suitability study."""
    repetitions: int = 1
    """Repetitions of each: repetition r has seed r and phase r / repetitions."""
    tsar: Unprefixed[TsarConfig] = field(default_factory=TsarConfig)
    """The pipeline of all runs; batch and resolution come from the row, the seed from the repetition."""
    start_s: float = 0.0
    """Animation time at which the measurement starts, seconds."""
    tolerance: float = 0.01
    """A format is safe if no run breaks an invariant and the mean error of all runs grows by at most this share."""
    markdown: bool = False
    """Print the tables as Markdown."""
    farm: Unprefixed[ClusterOptions] = field(default_factory=ClusterOptions)
    """Where the runs are computed."""
    out: Path = Path("out/precision")
    """Folder for the results."""
    references: References = REFERENCES

    def __post_init__(self) -> None:
        require_inputs(self.inputs)
        require_distinct(self, "inputs", "policies")
        require_rows("row", [self.row])
        limits.within(self, repetitions=limits.REPETITIONS, start_s=limits.TIMES_S, tolerance=(0.0, 10.0))
