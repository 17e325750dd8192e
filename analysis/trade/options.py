"""Options of the measurement of the speed–accuracy trade."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from analysis.command import limits
from analysis.command.cluster import ClusterOptions
from analysis.command.options import REFERENCES, References, Unprefixed
from analysis.metrics.cost_model import SEGMENTS_DEFAULT, Ledger
from analysis.metrics.display_model import DisplayModel
from analysis.study.asked import require_distinct
from analysis.study.inputs import INPUTS, require_input
from analysis.trade.knobs import chosen_knobs
from tsar.config import closed_choices


@dataclass(frozen=True)
@closed_choices()
class TradeOptions:
    """The cost of every knob and its effect on the error, alone and together with all others in a search. Runs that are
    on disk are not repeated."""

    inputs: tuple[str, ...] = INPUTS
    """Built-in inputs, or other scenes by their names; or scene files."""
    camera_path: Literal["turntable", "fly-through"] = "fly-through"
    """Motion of the camera of a scene file that has none."""
    scale: Literal["thesis", "half", "quick"] = "quick"
    """Sizes of the runs: as in the suitability study. quick: a quarter of the thesis' side, and half the rate of the
    reference."""
    seconds: float = 2.0
    """Animation time to measure, seconds."""
    repetitions: int = 2
    """Repetitions of each: repetition r has seed r, and phase r / repetitions where the input has phases."""
    knobs: tuple[str, ...] = ()
    """Names of the knobs to turn; all where none is named. An unknown name prints the list."""
    search_knobs: tuple[str, ...] = ()
    """Knobs of tsar that the search turns; all knobs that are named above where none is named."""
    trials: int = 48
    """Number of settings that the search tries; 0 makes no search."""
    at_once: int = 8
    """Number of settings that the search requests together, which then run in parallel."""
    search_seed: int = 0
    """Seed of the search."""
    ledger: Ledger = "work"
    """How cost is counted; in the column cost_flops: by default the traced rays, each at the price of a segment, and
    the operations around them; wall is refused, because its results are not repeatable."""
    trace_segments: float = SEGMENTS_DEFAULT
    """Ray segments per sample; for ledgers that do not count them."""
    jod_s: float = 0.5
    """Length of the part in the middle of a run that metrics of sequences score, seconds; 0 for no score."""
    display: DisplayModel = field(default_factory=DisplayModel)
    """The display that the score assumes."""
    draws: int = 1000
    """Number of bootstrap draws."""
    store: bool = False
    """Store this front as the one from which presets and budgets of run.py choose."""
    markdown: bool = False
    """Print the tables as Markdown."""
    farm: Unprefixed[ClusterOptions] = field(default_factory=ClusterOptions)
    """Where the runs are computed."""
    out: Path = Path("out/trade")
    """Folder for the results."""
    references: References = REFERENCES

    def __post_init__(self) -> None:
        require_distinct(self, "inputs")
        for input in self.inputs:
            require_input(input, "inputs")
        for name in ("knobs", "search_knobs"):
            chosen_knobs(getattr(self, name), name)
        limits.within(
            self,
            seconds=(0.05, 60.0),
            repetitions=limits.REPETITIONS,
            trials=(0, 100_000),
            at_once=(1, 1000),
            search_seed=limits.SEEDS,
            trace_segments=limits.SEGMENTS,
            jod_s=(0.0, max(self.seconds, TradeOptions.jod_s)),
            draws=(10, 100_000),
        )
