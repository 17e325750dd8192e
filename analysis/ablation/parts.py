"""Changes to the policy ``tsar``: each of its switches, and some of its numbers."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from tsar.config import require
from tsar.filtering.options import DEFAULT
from tsar.named import require_known

WHOLE = "all of it"
"""The policy as it is."""

OptionChanges = tuple[tuple[str, bool | int | float], ...]

_SWITCHED_OFF = {
    "jitter": "samples at the centres of their cells",
    "accumulation": "the newest sample replaces",
    "smoothing": "no blending at display",
    "by_gain": "pixels sampled in turn",
    "spread": "change not spread to neighbours",
    "reprojection": "estimates stay in their pixels",
    "prediction": "shown where it was last known to be",
    "shadows": "no change expected where shadows move",
    "probes": "no tile looks where nothing is expected",
    "noise": "noise is blended as detail is",
}
_CYCLES, _FINE, _PIXEL = 3, 2, 1


@dataclass(frozen=True)
class Part:
    """A change to the policy.

    Attributes:
        name: as one word, for the command line.
        words: what is changed.
        options: of :class:`tsar.filtering.records.FilterOptions`, by name in alphabetical order.
    """

    name: str
    words: str
    options: OptionChanges


def all_parts() -> tuple[Part, ...]:
    """Every switch that is on, turned off alone; then other numbers: latency, length of cycles, texture footprints."""
    switches = [one.name for one in dataclasses.fields(DEFAULT) if getattr(DEFAULT, one.name) is True]
    found = [Part(name.replace("_", "-"), _SWITCHED_OFF.get(name, f"no {name}"), ((name, False),)) for name in switches]
    unfiltered = (("footprint", _PIXEL), ("jitter", False))
    found += [
        Part("jitter-1x", "no jitter, textures filtered for the output's pixels", unfiltered),
        Part("latency", f"latency of {_CYCLES} cycles", (("latency_cycles", _CYCLES),)),
        Part("cycles", f"cycles {_CYCLES} times as long", (("share_max", _CYCLES * DEFAULT.share_max),)),
        Part("whole-batch", "a cycle takes the whole batch", (("share_max", 1.0),)),
        *(Part(f"footprint-{n}x", f"texture footprint {n}x", (("footprint", n),)) for n in (_PIXEL, _FINE)),
    ]
    return tuple(part for part in found if any(getattr(DEFAULT, name) != value for name, value in part.options))


def chosen_parts(names: Sequence[str]) -> tuple[Part, ...]:
    """Parts by their names; all parts where no name is given.

    Raises:
        ConfigError: a name is unknown, or given twice.
    """
    known = {part.name: part for part in all_parts()}
    for name in names:
        require_known(name, "parts", known)
    require(len(names) == len(set(names)), "parts", "none twice", tuple(names))
    return tuple(known[name] for name in names or known)
