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
from analysis.study.cases import INPUTS
from tsar.config import closed_choices


@dataclass(frozen=True)
@closed_choices()
class TradeOptions:
    """What every knob costs and what it does to the error: each alone, and all of them together in a search. Runs that
    are on disk are not repeated."""

    inputs: tuple[str, ...] = INPUTS
    """Built-in inputs, other scenes by their names, or scene files."""
    camera_path: Literal["turntable", "fly-through"] = "fly-through"
    """Motion of the camera of scene files."""
    scale: Literal["thesis", "half", "quick"] = "quick"
    """Sizes, as of the suitability study. quick: a quarter of the thesis' side, against a reference half as often."""
    seconds: float = 2.0
    """Simulated time of a run, seconds."""
    repetitions: int = 2
    """Runs of each: repetition r has seed r, and phase r / repetitions where the input has phases."""
    knobs: tuple[str, ...] = ()
    """Names of the knobs to turn; none turns all. A wrong name lists them."""
    search_knobs: tuple[str, ...] = ()
    """Of the knobs of tsar those that the search turns; none turns all that are named above."""
    trials: int = 48
    """Settings that the search tries; 0 makes no search."""
    at_once: int = 8
    """Settings that it asks for together, which are then run side by side."""
    search_seed: int = 0
    """Seed of the search."""
    ledger: Ledger = "work"
    """What the column cost_flops counts: by default the rays that were traced, each at the price of a segment, and the
    operations around them; wall is refused, for it gives no result twice."""
    trace_segments: float = SEGMENTS_DEFAULT
    """Ray segments per sample, for ledgers that do not count them."""
    jod_s: float = 0.5
    """Seconds in the middle of a run that ColorVideoVDP scores; 0 for no score."""
    display: DisplayModel = field(default_factory=DisplayModel)
    """The display that it scores for."""
    draws: int = 1000
    """Draws of the bootstrap."""
    store: bool = False
    """Make this the front that presets and budgets of run.py choose from, in place of the one that was there."""
    markdown: bool = False
    """Print the tables as Markdown."""
    farm: Unprefixed[ClusterOptions] = field(default_factory=ClusterOptions)
    """Where the runs are made."""
    out: Path = Path("out/trade")
    """Folder for the results."""
    cache: References = REFERENCES

    def __post_init__(self) -> None:
        require_distinct(self, "inputs")
        limits.within(
            self,
            seconds=(0.05, 60.0),
            repetitions=limits.REPETITIONS,
            trials=(0, 100_000),
            at_once=(1, 1000),
            search_seed=limits.SEEDS,
            trace_segments=limits.SEGMENTS,
            jod_s=(0.0, self.seconds),
            draws=(10, 100_000),
        )
