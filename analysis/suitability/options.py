"""Options of the suitability study."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from analysis.command import limits
from analysis.command.cluster import ClusterOptions
from analysis.command.options import REFERENCES, References, Unprefixed
from analysis.metrics.cost_model import SEGMENTS_DEFAULT, Ledger
from analysis.metrics.display_model import DisplayModel
from analysis.study.asked import require_distinct, require_inputs, require_named, require_rows
from analysis.study.cases import ROWS, SCALES
from analysis.study.inputs import INPUTS
from tsar.choices import SOLVERS
from tsar.config import TsarConfig, closed_choices, require
from tsar.policies import POLICIES, RIVALS


@dataclass(frozen=True)
@closed_choices()
class SuitabilityOptions:
    """Every run of table 7.2 at equal cost, beside the thesis' results. Runs that are on disk are not repeated."""

    inputs: tuple[str, ...] = INPUTS
    """Built-in inputs, or other scenes by their names."""
    rows: tuple[int, ...] = tuple(range(len(ROWS)))
    """Rows of table 7.2, 0 to 15."""
    scale: Literal["thesis", "half", "quick"] = "quick"
    """Sizes of the runs: thesis, its resolutions and batches; half, half the side, and a quarter of samples, tiles and
    machine speed; quick, a quarter of the side, and half the rate of the reference. All runs last 2 s."""
    repetitions: int = 3
    """Repetitions of each: repetition r has seed r and phase r / repetitions."""
    tsar: Unprefixed[TsarConfig] = field(default_factory=TsarConfig)
    """The adaptive pipeline; batch and resolution come from the row, the seed from the repetition."""
    policies: tuple[str, ...] = ("thesis",)
    """Policies to compare; at every row with framed, and with the best of the rivals at each moment."""
    rivals: tuple[str, ...] = RIVALS
    """Rivals at equal cost; at every row; framed is always one of them."""
    beside: tuple[str, ...] = ("oracle",)
    """Further policies, which are run at one row only, --policy-row."""
    solvers: tuple[str, ...] = ("trivial",)
    """Further transport solvers of thesis, which are compared with the chosen one at --policy-row."""
    policy_row: int = 7
    """Row of table 7.2, 0 to 15, at which --beside and --solvers are run."""
    ledger: Ledger = "thesis"
    """How cost is counted; wall is refused, because its results are not repeatable."""
    framed_rate_hz: float = 8.0
    """Images a second that the framed renderer shows at every resolution, which sets the speed of the machine."""
    trace_segments: float = SEGMENTS_DEFAULT
    """Ray segments per sample; of the cost model."""
    start_s: float = 0.0
    """Animation time at which the measurement starts, seconds."""
    metric_stride: int = 6
    """Interval, in reference images, at which metrics of images are taken: FLIP, SSIM and the causes of the error. At
    thesis scale they cost more than the runs themselves."""
    jod_repetitions: int = 1
    """Repetitions that ColorVideoVDP scores."""
    jod_span_s: tuple[float, float] = (0.4, 0.9)
    """Beginning and end of the part of each run that ColorVideoVDP scores, seconds after the start; scoring a second
    costs more than the run."""
    display: DisplayModel = field(default_factory=DisplayModel)
    """The display that ColorVideoVDP assumes."""
    farm: Unprefixed[ClusterOptions] = field(default_factory=ClusterOptions)
    """Where the runs are computed."""
    out: Path = Path("out/suitability")
    """Folder for the results."""
    references: References = REFERENCES

    def __post_init__(self) -> None:
        require_inputs(self.inputs)
        require_named(self, policies=POLICIES, rivals=POLICIES, beside=POLICIES, solvers=SOLVERS)
        require_distinct(self, "inputs", "rows", "policies")
        has_thesis = "thesis" in (*self.policies, *self.rivals)
        require(
            has_thesis or self.solvers in ((), ("trivial",)), "solvers", "none without the policy thesis", self.solvers
        )
        require_rows("rows", self.rows)
        require_rows("policy_row", [self.policy_row])
        limits.within(
            self,
            repetitions=limits.REPETITIONS,
            jod_repetitions=(0, limits.REPETITIONS[1]),
            metric_stride=(1, 1000),
            framed_rate_hz=(0.01, 1000.0),
            trace_segments=limits.SEGMENTS,
            start_s=limits.TIMES_S,
            jod_span_s=(0.0, SCALES[self.scale].seconds),
        )
        self.display.repeats(SCALES[self.scale].reference_rate_hz)
