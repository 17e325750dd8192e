"""What renderers other than LuxCore and this one do not have of glass."""

from __future__ import annotations

from scenes.canonical import Glass
from scenes.formats.losses import LossReport


def lose_rays(material: Glass, where: str, report: LossReport) -> None:
    """Reports rays that are spread, and a pane of which only the front reflects."""
    if material.spread_deg:
        report.add(where, "rays spread about the perfect ones", "clear glass")
    lose_front(material, where, report)


def lose_front(material: Glass, where: str, report: LossReport) -> None:
    """Reports a pane of which only the front reflects."""
    if material.thin and material.front_only:
        report.add(where, "architectural glass", "a pane, which reflects as much at its back")
