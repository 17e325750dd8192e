"""What a benchmark is made of: its options, a row of its table, and turns between ours and a peer.

Cases take turns, so that a machine's ups and downs fall on all alike, and a ratio is the median of the ratios of the
rounds. Rows are measured by ``analysis/bench_*.py``; :mod:`analysis.bench.run` puts them together.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from statistics import median, quantiles
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from analysis.command import limits
from tsar.config import closed_choices, require

if TYPE_CHECKING:
    from analysis.command.progress import Bars

GROUPS = ("coherent", "incoherent", "shaded", "cores", "order", "features", "overhead", "growth", "conversion", "start")
"""Groups of rows, in the order of the table."""

ON_CPU_ONLY = ("coherent", "incoherent", "cores", "conversion", "start")
"""Groups of what does not run on a GPU."""

SPREAD = "quartiles of the ratio over the repetitions"
NOT_INSTALLED = "peer not installed"

_FEWEST_REPETITIONS = 7


@dataclass(frozen=True)
@closed_choices()
class BenchOptions:
    """How fast the simulator is, and beside whom: rays, shaded samples, overhead, growth, start."""

    out: Path = Path("out/bench")
    """Folder for bench.json and summary.json; on a GPU bench-cuda.json and summary-cuda.json."""
    only: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """A group, or several with commas between; may be repeated. Without it all run: coherent, incoherent, shaded,
    cores, order, features, overhead, growth, conversion, start."""
    compare: tuple[Path, Path] | None = None
    """Two bench.json whose figures of ours are compared; runs nothing."""
    device: Literal["cpu", "cuda:0"] = "cpu"
    """Where our side runs; peers stay on the CPU."""
    repetitions: int = 9
    """Turns of each case; medians count."""
    resolution_px: int = 512
    """Side of the pictures, pixels, a power of two."""
    subdivisions: tuple[int, ...] = (4, 5, 6, 8)
    """Meshes of the groups coherent and incoherent, of 20 * 4^subdivisions triangles."""
    batch_size: int = 128
    """Framelets per batch."""
    cycles: int = 10_000
    """Cycles over which the group growth watches memory."""
    scenes: tuple[str, ...] = ()
    """Built-in scenes; all where none is named."""
    scene_files: tuple[Path, ...] = ()
    """Scene files that the group conversion converts; the delivered Cornell boxes where none is named."""
    scene_root: Path | None = None
    """Folder that they may read from; by default their own."""

    def __post_init__(self) -> None:
        for name in self.groups:
            require(name in GROUPS, "only", f"one of {', '.join(GROUPS)}", name)
        least = _FEWEST_REPETITIONS
        limits.within(self, repetitions=(least, limits.REPETITIONS[1]), subdivisions=(0, 9), cycles=(100, 10**6))
        side = self.resolution_px
        require(64 <= side <= 4096 and side & (side - 1) == 0, "resolution_px", "a power of two in [64, 4096]", side)
        most = (side // FRAMELET_SIDE) ** 2
        require(1 <= self.batch_size <= most, "batch_size", f"between 1 and {most}, a picture's", self.batch_size)
        for file in self.scene_files:
            require(file.is_file(), "scene_files", "scene files", file)

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups to run, in the order of the table."""
        asked = [name.strip() for part in self.only for name in part.split(",")] or list(GROUPS)
        known = [name for name in GROUPS if name in asked]
        return tuple(known + [name for name in asked if name not in GROUPS])

    @property
    def file_ending(self) -> str:
        """What sets apart the names of files that hold figures of a GPU."""
        return "" if self.device == "cpu" else "-cuda"


FRAMELET_SIDE = 16


@dataclass(frozen=True)
class Row:
    """One measured figure beside a peer's, or beside the limit that it is to keep.

    Attributes:
        ours, peer: medians in ``unit``; ``peer`` is None where there is none to compare with.
        peer_name: who, or what limit.
        ratio: above 1 ours is faster than the peer, or within the limit.
        spread: quartiles of the ratio over the repetitions.
        target: least ratio that is asked for; None where none is.
        repetitions: rounds, or cycles, that the medians are over.
        less_is_better: whether ``ours`` is a time or a share rather than a rate.
        note: what else must be known to judge the figure.
    """

    group: str
    name: str
    unit: str
    ours: float
    peer_name: str = ""
    peer: float | None = None
    ratio: float | None = None
    spread: tuple[float, float] | None = None
    target: float | None = None
    repetitions: int = 1
    less_is_better: bool = False
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the target is reached; None where there is no target, or nobody to compare with."""
        return None if self.target is None or self.ratio is None else self.ratio >= self.target

    def record(self) -> dict[str, Any]:
        """The row as it is stored."""
        return {**dataclasses.asdict(self), "met": self.met}


Group = Callable[["BenchOptions", "Bars"], Iterator[Row]]
"""Measures the rows of one group and shows how far it is."""


def counted(show: Callable[[int], None]) -> Callable[..., None]:
    """A function that moves a bar on by one at each call, whatever it is called with."""
    done = count(1)
    return lambda *_: show(next(done))


def spread_of(ratios: Sequence[float]) -> tuple[float, float] | None:
    """Quartiles; None where there are fewer than two values."""
    if len(ratios) < 2:
        return None
    low, _, high = quantiles(ratios, n=4)
    return low, high


def rate_row(
    row: Row, work: float, ours_s: Sequence[float], peer_s: Sequence[float] | None, target: float | None = None
) -> Row:
    """Fills a row with rates.

    Args:
        row: group, name, unit, name of the peer, and note.
        work: what is done in one round, in the numerator of ``unit``.
        ours_s, peer_s: seconds of each round; None for the peer where it cannot be had.
        target: least ratio.
    """
    filled = dataclasses.replace(row, ours=work / median(ours_s), target=target, repetitions=len(ours_s))
    if peer_s is None:
        return filled
    ratios = [theirs / mine for mine, theirs in zip(ours_s, peer_s, strict=True)]
    return dataclasses.replace(filled, peer=work / median(peer_s), ratio=median(ratios), spread=spread_of(ratios))


def limit_row(row: Row, values: Sequence[float], limit: float) -> Row:
    """Fills a row with positive values that are to stay within a limit: the ratio is the limit over the value, and the
    target 1."""
    return limited_row(row, values, limit, [limit / value for value in values])


def limited_row(row: Row, values: Sequence[float], limit: float, ratios: Sequence[float]) -> Row:
    """As :func:`limit_row`, with ratios of the caller's: at least 1 within the limit."""
    return dataclasses.replace(
        row,
        ours=median(values),
        peer=limit,
        ratio=median(ratios),
        spread=spread_of(ratios),
        target=1.0,
        repetitions=len(values),
        less_is_better=True,
    )
