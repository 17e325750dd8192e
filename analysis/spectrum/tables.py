"""The summary of the study of spectra as tables of text."""

from __future__ import annotations

from typing import Any

from analysis.command.console import Table


def tables(summary: dict[str, Any]) -> list[Table]:
    """A table for each part that ran."""
    found = []
    if slopes := summary.get("slopes"):
        rows = []
        for name, group in slopes["groups"].items():
            values = [f"{group['slope'][key]:.2f}" for key in ("mean", "least", "greatest")]
            rows.append((name, str(group["count"]), *values, f"{group['slope_linear']['mean']:.2f}"))
        header = ("group", "count", "mean", "least", "greatest", "linear, mean")
        found.append(Table("Power-spectrum slopes", header, rows))
    if ideal := summary.get("ideal"):
        title = f"Ideal density of tile {ideal['tile']['index']}, level {ideal['tile']['level']}"
        rows = [(f"{row['samples_per_pixel_side']:.3g}²", f"{row['refresh_ms']:.3g} ms") for row in [ideal]]
        found.append(Table(title, ("samples per pixel", "refresh interval"), rows))
    if check := summary.get("agreement"):
        sets = {"all": check["all"], "changing tiles": check["changing_tiles"], **check["inputs"]}
        sets = {**sets, "one update": check["one_update"]}
        columns = ("tiles", "number", "angle, deg", "permuted", "within 45°", "permuted", "same quadrant", "permuted")
        rows = [(name, str(row["tiles"]), *_cells(row)) for name, row in sets.items() if row]
        found.append(Table("Estimate against the direction to Θ* (permuted: estimates of other tiles)", columns, rows))
    return found


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    angle, within, quadrant = row["angle_median_deg"], row["share_within_45_deg"], row["share_same_quadrant"]
    percent = [f"{100 * share[key]:.0f} %" for share in (within, quadrant) for key in ("value", "permuted")]
    return f"{angle['value']:.0f}", f"{angle['permuted']:.0f}", *percent
