"""Peers that a benchmark wants and lacks, which it names before it measures anything."""

from __future__ import annotations

from collections.abc import Sequence

from analysis.bench import embree, mitsuba
from analysis.bench.machine import installed
from analysis.command.extras import installed_by

WANTED_BY = {
    "embree": ("coherent", "incoherent", "large"),
    "mitsuba": ("shaded",),
    "pywavelets": ("overhead",),
}
"""Groups of the benchmark that compare with each peer."""


def missing_peers(groups: Sequence[str]) -> list[str]:
    """One line for each peer of the groups that cannot run here: what is missing, and what installs it."""

    def wanted(peer: str) -> bool:
        return not set(groups).isdisjoint(WANTED_BY[peer])

    lines = []
    if wanted("embree") and (reason := embree.missing()):
        lines.append(f"no figures of Embree: {reason}")
    if wanted("mitsuba"):
        reasons = {variant: mitsuba.missing(variant) for variant in mitsuba.VARIANTS}
        lines += [f"no figures of Mitsuba's {variant}: {reason}" for variant, reason in reasons.items() if reason]
    if wanted("pywavelets") and not installed("pywt"):
        lines.append("no figures of PyWavelets: it is not installed")
    if any("not installed" in line for line in lines):
        lines.append(f"Packages: {installed_by('peers')}")
    return lines
