"""Options of the study of the parts of the policy tsar."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from analysis.command import limits
from analysis.command.cluster import ClusterOptions
from analysis.command.options import REFERENCES, References, Unprefixed
from analysis.metrics.cost_model import SEGMENTS_DEFAULT, Ledger
from analysis.study.asked import require_distinct, require_inputs, require_named, require_rows
from analysis.study.inputs import INPUTS
from tsar.config import TsarConfig, closed_choices
from tsar.policies import POLICIES, RIVALS


@dataclass(frozen=True)
@closed_choices()
class AblationOptions:
    """The policy tsar with each part left out alone, the terms of its error, and its distance from a
    perfect picture of the same latency. Runs that are on disk are not repeated."""

    inputs: tuple[str, ...] = INPUTS
    """Built-in inputs, or other scenes by their names."""
    rows: tuple[int, ...] = (7,)
    """Rows of table 7.2, 0 to 15."""
    scale: Literal["thesis", "half", "quick"] = "quick"
    """Sizes of the runs: as in the suitability study. quick: a quarter of the thesis' side, and half the rate of the
    reference."""
    repetitions: int = 3
    """Repetitions of each: repetition r has seed r and phase r / repetitions."""
    parts: tuple[str, ...] = ()
    """Names of the parts to change, a run each; all parts where none is named. An unknown name prints the list."""
    tsar: Unprefixed[TsarConfig] = field(default_factory=TsarConfig)
    """The pipeline of all runs; batch and resolution come from the row, the seed from the repetition."""
    rivals: tuple[str, ...] = RIVALS
    """Rivals at equal cost; their lowest error at each moment is that of the best rival; framed is always one of
    them."""
    before_s: float = 0.1
    """Seconds: a surface out of sight this long before counts as disocclusion, one whose light changed as a shadow."""
    ledger: Ledger = "thesis"
    """How cost is counted; wall is refused, because its results are not repeatable."""
    framed_rate_hz: float = 8.0
    """Images a second that the framed renderer shows at every resolution, which sets the speed of the machine."""
    trace_segments: float = SEGMENTS_DEFAULT
    """Ray segments per sample; of the cost model."""
    start_s: float = 0.0
    """Animation time at which the measurement starts, seconds."""
    markdown: bool = False
    """Print the tables as Markdown."""
    farm: Unprefixed[ClusterOptions] = field(default_factory=ClusterOptions)
    """Where the runs are computed."""
    out: Path = Path("out/ablation")
    """Folder for the results."""
    references: References = REFERENCES

    def __post_init__(self) -> None:
        require_inputs(self.inputs)
        require_named(self, rivals=POLICIES)
        require_distinct(self, "inputs", "rows")
        require_rows("rows", self.rows)
        limits.within(
            self,
            repetitions=limits.REPETITIONS,
            before_s=(0.001, 10.0),
            framed_rate_hz=(0.01, 1000.0),
            trace_segments=limits.SEGMENTS,
            start_s=limits.TIMES_S,
        )
