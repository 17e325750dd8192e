"""Rows of the benchmark's table: a figure of ours beside that of a peer, or beside a limit."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from statistics import median, quantiles
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from analysis.bench.options import BenchOptions
    from analysis.command.progress import Bars

SPREAD = "quartiles of the ratio over the repetitions"
NOT_INSTALLED = "peer not installed"


@dataclass(frozen=True)
class Row:
    """One measured figure beside a peer's, or beside its limit.

    Attributes:
        ours, peer: medians in ``unit``; ``peer`` is None where there is no peer.
        peer_name: name of the peer, or of the limit.
        ratio: above 1 ours is faster than the peer, or within the limit.
        spread: quartiles of the ratio over the repetitions.
        target: least ratio to reach; None where there is none.
        repetitions: number of rounds, or cycles, behind the medians.
        less_is_better: whether ``ours`` is a time or a share rather than a rate.
        note: further information needed to judge the figure.
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
        """Whether the target is reached; None where there is no target or no peer."""
        return None if self.target is None or self.ratio is None else self.ratio >= self.target

    def record(self) -> dict[str, Any]:
        """The row as it is stored."""
        return {**dataclasses.asdict(self), "met": self.met}


Group = Callable[["BenchOptions", "Bars"], Iterator[Row]]
"""Measures the rows of one group and shows its progress."""


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
        work: amount of work in one round, in the numerator of ``unit``.
        ours_s, peer_s: seconds of each round; None for a peer that is not available.
        target: least ratio.
    """
    filled = dataclasses.replace(row, ours=work / median(ours_s), target=target, repetitions=len(ours_s))
    if peer_s is None:
        return filled
    ratios = [theirs / mine for mine, theirs in zip(ours_s, peer_s, strict=True)]
    return dataclasses.replace(filled, peer=work / median(peer_s), ratio=median(ratios), spread=spread_of(ratios))


def limit_row(row: Row, values: Sequence[float], limit: float) -> Row:
    """Fills a row with positive values that must stay within a limit: the ratio is the limit over the value, and the
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
