"""Options of the cost report: the parameters of table 7.1, the candidates to admit, the measurement."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from analysis.command import limits
from analysis.command.options import Device, Threads, Unprefixed
from analysis.metrics.cost_model import CostParameters
from analysis.study.asked import require_inputs
from tsar.config import TsarConfig, closed_choices, require

_FEWEST_BATCHES, _FEWEST_RESOLUTIONS = 3, 3


@dataclass(frozen=True)
@closed_choices()
class MeasurementOptions:
    """The runs that are compared with the model."""

    input: str = "fly-by"
    """Built-in input, by name or number."""
    measured_batches: tuple[int, ...] = (32, 64, 128, 256, 512)
    """Batch sizes measured at the output side measured_resolution."""
    measured_resolutions: tuple[int, ...] = (128, 256, 512, 1024)
    """Output sides measured at the batch size measured_batch, pixels."""
    measured_batch: int = 128
    """Batch size at which output sides are compared."""
    measured_resolution: int = 512
    """Output side at which batch sizes are compared, pixels."""
    repetitions: int = 10
    """Repetitions of each; turns of a setting."""
    cycles_per_turn: int = 4
    """Pipeline cycles that a setting runs in each turn."""
    cycle_s: float = 0.02
    """Animation time of a cycle, seconds: about that of the ledger thesis at the defaults."""
    measured_warmup: int = 0
    """Cycles of every setting before it is measured; 0 runs until the cache is full, and at least 48."""
    memory_cycles: int = 600
    """Cycles over which resident memory is watched; 0 leaves it out."""
    memory_every: int = 10
    """Cycles between two readings of resident memory."""
    device: Device = "cpu"
    threads: Threads = 0

    def __post_init__(self) -> None:
        require_inputs((self.input,), "input", numbers=True)
        for name in ("measured_batches", "measured_resolutions"):
            least = _FEWEST_BATCHES if name == "measured_batches" else _FEWEST_RESOLUTIONS
            values = getattr(self, name)
            require(len(set(values)) >= least, name, f"at least {least} different values", values)
        limits.within(
            self,
            measured_batches=(1, 8192),
            measured_batch=(1, 8192),
            measured_resolutions=(64, 8192),
            measured_resolution=(64, 8192),
            repetitions=limits.REPETITIONS,
            cycles_per_turn=(1, 10_000),
            cycle_s=(1e-6, 3600.0),
            measured_warmup=(0, 100_000),
            memory_cycles=(0, limits.CYCLES_MOST),
            memory_every=(1, limits.CYCLES_MOST),
            threads=limits.THREADS,
        )
        asked = self.repetitions * self.cycles_per_turn * len(self.settings)
        limits.require_count("repetitions", self.repetitions, asked, "cycles measured")
        few = self.memory_cycles == 0 or self.memory_cycles >= 4 * self.memory_every
        require(few, "memory_cycles", "0, or at least 4 times memory_every", self.memory_cycles)
        for setting in self.settings:
            self.pipeline(*setting)

    @property
    def settings(self) -> list[tuple[int, int]]:
        """Batch size and output side of every setting."""
        batches = [(batch, self.measured_resolution) for batch in self.measured_batches]
        sides = [(self.measured_batch, side) for side in self.measured_resolutions]
        return sorted({*batches, *sides, self.centre})

    @property
    def centre(self) -> tuple[int, int]:
        """The setting at which all ledgers are compared."""
        return self.measured_batch, self.measured_resolution

    def pipeline(self, batch_size: int, resolution_px: int) -> TsarConfig:
        """Configuration of a setting; everything else has the pipeline's defaults."""
        config = TsarConfig(batch_size=batch_size, resolution_px=resolution_px)
        full = max(config.warmup_cycles, -(-config.cache_slots // batch_size))
        return dataclasses.replace(config, warmup_cycles=self.measured_warmup or full)


@dataclass(frozen=True)
@closed_choices()
class CostReportOptions:
    """Cost of an adaptive cycle and of a framed image: the model under every ledger, and this machine."""

    parameters: Unprefixed[CostParameters] = field(default_factory=CostParameters)
    """The model's parameters, table 7.1."""
    measurement: Unprefixed[MeasurementOptions] = field(default_factory=MeasurementOptions)
    """The measurement on this machine."""
    ledger: Literal["thesis", "printed", "summed"] = "thesis"
    """How cost is counted; figures show this ledger, tables all of them."""
    batches: tuple[int, ...] = (32, 64, 128, 256, 512, 768, 1024)
    """Batch sizes that may be admitted."""
    resolutions: tuple[int, ...] = (256, 512, 1024)
    """Output sides that may be admitted, pixels."""
    admitted_segments: float = 4
    """Ray segments per sample at which they may be admitted; the thesis' inputs have about as many."""
    measure: bool = True
    """Run the pipeline on this machine and refit the model to it."""
    out: Path = Path("out/cost")
    """Folder for the results."""

    def __post_init__(self) -> None:
        for name in ("batches", "resolutions"):
            values = getattr(self, name)
            require(len(values) > 0, name, "at least one number", values)
        segments = (0.0, limits.SEGMENTS[1])
        bounds = dict.fromkeys((item.name for item in dataclasses.fields(CostParameters)), (1e-6, 1e15))
        limits.within(self.parameters, **{**bounds, "trace_segments": segments})
        for name in ("tree_size", "tiling_size"):
            value = getattr(self.parameters, name)
            require(value > 1, name, "more than 1, because the model takes its logarithm", value)
        limits.within(self, batches=(1, 1 << 20), resolutions=limits.SIDES_PX, admitted_segments=segments)
        _ = self.admitting

    @property
    def admitting(self) -> CostParameters:
        """The parameters with the segments at which combinations are admitted."""
        return dataclasses.replace(self.parameters, trace_segments=self.admitted_segments)
