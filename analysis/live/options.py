"""Options of the live view, and what can be changed while it runs."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from analysis.command import limits
from analysis.command.options import Seed, Threads
from tsar.choices import SOLVERS
from tsar.config import ErrorConfig, ResponseConfig, TsarConfig, closed_choices, require
from tsar.policies import POLICIES

NEED_THE_TRUTH = ("oracle",)
"""Policies that look at the picture as it should be, which nobody has in time."""
NOTHING = "none"
"""No run on a side."""
LATENCY_MOST = 8
RESOLUTIONS = (64, 128, 256, 512, 1024)
BATCHES = (8, 16, 32, 64, 128, 256, 512, 1024)


def policies() -> list[str]:
    """Names of those that can be seen live."""
    return [name for name in POLICIES if name not in NEED_THE_TRUTH]


@dataclass(frozen=True)
@closed_choices()
class Controls:
    """What is seen, and how it is made. The start of the live view is the first of them; its page changes them."""

    left: str = "framed"
    """Policy on the left, or none."""
    right: str = "tsar"
    """Policy on the right, or none."""
    batch_size: int = 128
    """Framelets rendered per cycle."""
    resolution_px: int = 512
    """Width and height of the pictures, pixels, a power of two."""
    latency_cycles: int = 0
    """Cycles from sampling to display, 0 to 8; 0 for each policy's own."""
    spatial_slope: float = ErrorConfig.spatial_slope
    """Slope of the template over spatial octaves; of the error estimate of thesis."""
    temporal_slope: float = ErrorConfig.temporal_slope
    """Slope of the template over temporal octaves; the same."""
    bias: float = ResponseConfig.bias
    """Octaves towards space, negative towards time; of thesis."""
    solver: str = ResponseConfig.solver
    """Solver of density transport; of thesis."""

    def __post_init__(self) -> None:
        for side in ("left", "right"):
            name = getattr(self, side)
            if name != NOTHING:
                POLICIES.require(name, side)
            require(name not in NEED_THE_TRUTH, side, "a policy that does not look at the truth", name)
        require(self.left != self.right or self.left == NOTHING, "right", "another policy than the left", self.right)
        least = 0 <= self.latency_cycles <= LATENCY_MOST
        require(least, "latency_cycles", f"between 0 and {LATENCY_MOST}", self.latency_cycles)
        SOLVERS.require(self.solver, "solver")
        self.config()

    @property
    def sides(self) -> tuple[str, ...]:
        """Policies that run."""
        return tuple(name for name in (self.left, self.right) if name != NOTHING)

    def config(self, seed: int = 0) -> TsarConfig:
        """Of all runs."""
        return TsarConfig(
            batch_size=self.batch_size,
            resolution_px=self.resolution_px,
            seed=seed,
            error=ErrorConfig(spatial_slope=self.spatial_slope, temporal_slope=self.temporal_slope),
            response=ResponseConfig(bias=self.bias, solver=self.solver),
        )

    def changed(self, name: str, value: Any) -> Controls:
        """With another value, of the type that the field has.

        Raises:
            ConfigError: there is no such field, or it cannot have the value.
        """
        fields = {one.name: type(getattr(self, one.name)) for one in dataclasses.fields(self)}
        require(name in fields, "control", f"one of {', '.join(fields)}", name)
        kind = fields[name]
        fits = isinstance(value, str) if kind is str else isinstance(value, int | float) and not isinstance(value, bool)
        require(fits and (kind is not int or int(value) == value), name, f"a value like {getattr(self, name)!r}", value)
        return dataclasses.replace(self, **{name: kind(value)})


@dataclass(frozen=True)
@closed_choices()
class LiveOptions:
    """A scene that is driven through, on a page of this machine."""

    input: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="INPUT")]
    """Built-in scene (by name or number), a scene file, a model, or a recorded session."""
    controls: Annotated[Controls, tyro.conf.arg(name=""), tyro.conf.OmitArgPrefixes] = dataclasses.field(
        default_factory=Controls
    )
    """What is seen at first."""
    phase: float = 0.0
    """Phase of the animation."""
    camera_path: Literal["", "turntable", "fly-through"] = ""
    """Motion of the camera of a scene file that has none."""
    seed: Seed = 0
    threads: Threads = 0
    reference_samples_per_axis: int = 3
    """Samples along a pixel's side in the reference; the truth that frozen pictures are compared with."""
    host: str = "127.0.0.1"
    """Address to listen at. Any other than this machine's own lets other machines in, with the key that is printed."""
    port: int = 8090
    """Port of the page; 0 takes a free one."""
    bench: bool = False
    """Show no page: drive for a while at several sizes, and print the cycle rates."""
    bench_seconds: float = 5.0
    """Seconds of each of these drives."""
    out: Path = Path("out/live")
    """Folder for the results; recorded sessions."""

    def __post_init__(self) -> None:
        limits.within(
            self,
            phase=(0.0, 1.0),
            threads=limits.THREADS,
            reference_samples_per_axis=(1, 16),
            port=(0, 65535),
            seed=limits.SEEDS,
            bench_seconds=(0.01, 600.0),
        )
