"""Measure what the error estimate rests on.

Power-spectrum slopes of frames, framelets and pictures (figs 1.3, 1.4), the ideal sample density of a tile
(figs 5.3–5.5), and whether the streaming estimate points at it.

Examples: python scripts/spectrum.py --out out/spectrum
          python scripts/spectrum.py photograph.jpg render.exr --only slopes
"""

from __future__ import annotations

from typing import Any

from analysis.command.cli import parse
from analysis.spectrum.options import SpectrumOptions


def main() -> None:
    """Parses, measures, prints what came out and where it is."""
    options = parse(SpectrumOptions, __doc__ or "")
    from analysis.spectrum.run import run_study

    summary = run_study(options)

    from rich.table import Table

    from analysis.command.console import console

    shown = console()
    for title, columns, rows in tables(summary):
        table = Table(title=title, title_justify="left")
        for number, column in enumerate(columns):
            table.add_column(column, justify="right" if number else "left")
        for row in rows:
            table.add_row(*row)
        shown.print(table)
    names = ", ".join(sorted(path.name for path in options.out.iterdir() if path.suffix in (".png", ".json")))
    shown.print(f"written to {options.out}: {names}")


def tables(summary: dict[str, Any]) -> list[tuple[str, tuple[str, ...], list[tuple[str, ...]]]]:
    """Title, columns and rows of a table for each part that ran."""
    found = []
    if slopes := summary.get("slopes"):
        rows = []
        for name, group in slopes["groups"].items():
            values = [f"{group['slope'][key]:.2f}" for key in ("mean", "least", "greatest")]
            rows.append((name, str(group["count"]), *values, f"{group['slope_linear']['mean']:.2f}"))
        found.append(("Power-spectrum slopes", ("group", "count", "mean", "least", "greatest", "linear, mean"), rows))
    if ideal := summary.get("ideal"):
        title = f"Ideal density of tile {ideal['tile']['index']}, level {ideal['tile']['level']}"
        rows = [(f"{row['samples_per_pixel_side']:.3g}²", f"{row['refresh_ms']:.3g} ms") for row in [ideal]]
        found.append((title, ("samples per pixel", "refresh interval"), rows))
    if check := summary.get("agreement"):
        sets = {"all": check["all"], "changing tiles": check["changing_tiles"], **check["inputs"]}
        sets = {**sets, "one update": check["one_update"]}
        columns = ("tiles", "number", "angle, deg", "dealt", "within 45°", "dealt", "same quadrant", "dealt")
        rows = [(name, str(row["tiles"]), *_cells(row)) for name, row in sets.items() if row]
        found.append(("Estimate against the direction to Θ* (dealt: estimates of other tiles)", columns, rows))
    return found


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    angle, within, quadrant = row["angle_median_deg"], row["share_within_45_deg"], row["share_same_quadrant"]
    percent = [f"{100 * share[key]:.0f} %" for share in (within, quadrant) for key in ("value", "dealt")]
    return f"{angle['value']:.0f}", f"{angle['dealt']:.0f}", *percent
