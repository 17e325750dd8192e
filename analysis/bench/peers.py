"""Peers that a benchmark wants and lacks, which it names before it measures anything."""

from __future__ import annotations

from collections.abc import Sequence

from analysis.bench import embree, mitsuba
from analysis.bench.machine import installed
from analysis.bench.rows import NOT_INSTALLED
from analysis.command.extras import installed_by

WANTED_BY = {
    "embreex": ("coherent", "incoherent", "large"),
    "mitsuba": ("shaded",),
    "pywt": ("overhead",),
}
"""Groups of the benchmark that compare with the peer in each module."""


def missing_peers(groups: Sequence[str]) -> list[str]:
    """One line for each peer of the groups that cannot run here: what is missing, and what installs it."""
    wanted = [module for module, of in WANTED_BY.items() if not set(groups).isdisjoint(of)]
    reasons = dict[str, str]()
    if "embreex" in wanted:
        reasons["Embree"] = embree.missing()
    if "mitsuba" in wanted:
        reasons |= {f"Mitsuba's {variant}": mitsuba.missing(variant) for variant in mitsuba.VARIANTS}
    if "pywt" in wanted:
        reasons["PyWavelets"] = "" if installed("pywt") else NOT_INSTALLED
    lines = [f"no figures of {name}: {reason}" for name, reason in reasons.items() if reason]
    return lines if all(map(installed, wanted)) else [*lines, f"Packages: {installed_by('peers')}"]
