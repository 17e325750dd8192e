"""The measured front of cost and error that presets and budgets choose from.

The front is a file of this package (``front.json``), which ``scripts/trade.py --store`` writes. Costs in it are for
each pixel of the display and simulated second, so that they hold at any resolution and for any length of a run.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

STORED = Path(__file__).with_name("front.json")
PresetName = Literal["draft", "balanced", "accurate"]


@dataclass(frozen=True)
class FrontPoint:
    """A setting of the policy ``tsar`` on the front.

    Attributes:
        batch: framelets of 16 x 16 samples, 50 times a second, for 512 x 512 pixels.
        parts: other options of the policy that differ from its defaults, by name in alphabetical order.
        flops: operations per pixel and simulated second, by ledger.
        wall_s: wall seconds of its cycles per pixel and simulated second, on the machine that measured it.
        mse: mean squared error, the geometric mean over the inputs that it was measured on.
        cost, error: over those of the default.
        knee: whether it is the knee.
    """

    batch: int
    parts: tuple[tuple[str, bool | int | float], ...]
    flops: Mapping[str, float]
    wall_s: float
    mse: float
    cost: float
    error: float
    knee: bool

    @property
    def words(self) -> str:
        """The setting in words."""
        return ", ".join([f"batch {self.batch}", *(f"{name} {value:g}" for name, value in self.parts)])


@dataclass(frozen=True)
class Front:
    """Points in order of rising cost and falling error, and the conditions of their measurement.

    Attributes:
        places: at least one.
        made: scale, inputs, seeds and ledger.
    """

    places: tuple[FrontPoint, ...]
    made: Mapping[str, Any]

    @property
    def knee(self) -> FrontPoint:
        """The knee of the front."""
        return next(one for one in self.places if one.knee)

    def preset(self, name: PresetName) -> FrontPoint:
        """The knee (``balanced``), or an end of the front: the cheapest point (``draft``), or the most accurate one."""
        return {"draft": self.places[0], "balanced": self.knee, "accurate": self.places[-1]}[name]

    def within_flops(self, flops: float, ledger: str) -> FrontPoint:
        """The most accurate point of at most ``flops`` operations per pixel and second; the cheapest if there is
        none."""
        return self._most_accurate(flops, lambda place: place.flops[ledger])

    def within_seconds(self, wall_s: float) -> FrontPoint:
        """The most accurate point of at most ``wall_s`` wall seconds per pixel and second; the fastest if there is
        none."""
        return self._most_accurate(wall_s, lambda place: place.wall_s)

    def at_error(self, mse: float) -> FrontPoint:
        """The cheapest point of at most this error; the most accurate if there is none."""
        good = [place for place in self.places if place.mse <= mse]
        return min(good, key=lambda place: place.cost) if good else min(self.places, key=lambda place: place.mse)

    def _most_accurate(self, most: float, cost: Any) -> FrontPoint:
        affordable = [place for place in self.places if cost(place) <= most * (1.0 + 1e-9)]
        return min(affordable, key=lambda place: place.mse) if affordable else min(self.places, key=cost)


@lru_cache(maxsize=1)
def stored_front() -> Front:
    """The front of this package."""
    return read_front(STORED)


def read_front(path: Path) -> Front:
    """A front from its file.

    Raises:
        ValueError: the file does not hold a front.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        places = tuple(_place(**one) for one in found["places"])
        front = Front(places, found["made"])
        front.knee  # noqa: B018 - a front without one is refused here
    except (OSError, ValueError, TypeError, KeyError, AttributeError, StopIteration) as error:
        raise ValueError(f"{path}: expected a front of trade.py ({type(error).__name__}: {error})") from error
    return front


def _place(
    batch: int, parts: Mapping[str, Any], flops: Mapping[str, float], wall_s: float, mse: float, cost: float,
    error: float, knee: bool,
) -> FrontPoint:  # fmt: skip
    numbers = (batch, wall_s, mse, cost, error, *flops.values())
    if not all(math.isfinite(value) and value > 0.0 for value in numbers):
        raise ValueError(f"numbers above 0, got {numbers}")
    return FrontPoint(batch, tuple(sorted(parts.items())), dict(flops), wall_s, mse, cost, error, knee)
