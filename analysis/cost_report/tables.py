"""The cost report's summary as tables of text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from analysis.command.console import Table
from analysis.metrics.cost_model import MODELLED

_MIB = 2.0**20


def tables(summary: Mapping[str, Any]) -> list[Table]:
    """Every table, with those of the measurement if there is one."""
    found = [ledger_table(name, entry) for name, entry in summary["ledgers"].items()]
    found.append(advantage_table(summary))
    measurement = summary["measurement"]
    if measurement:
        found += [refit_table(measurement), setting_table(measurement), growth_table(measurement)]
        if measurement["memory"]:
            found.append(memory_table(measurement["memory"]))
    return found


def ledger_table(name: str, entry: Mapping[str, Any]) -> Table:
    """Cost of each stage under one ledger, per cycle and per output pixel."""
    scale, unit, pixel_scale, pixel_unit = (1e-6, "MFLOP", 1.0, "FLOP")
    if entry["unit"] == "s":
        scale, unit, pixel_scale, pixel_unit = (1e3, "ms", 1e9, "ns")
    cycle, pixel = entry["per_cycle"], entry["per_pixel"]
    total = cycle["adaptive"]["total"]
    rows = []
    for stage, cost in cycle["adaptive"].items():
        shown = f"adaptive, {stage}" if stage == "total" else stage
        share = f"{100 * cost / total:.2f} %"
        rows.append((shown, f"{cost * scale:,.4g}", f"{pixel['adaptive'][stage] * pixel_scale:,.4g}", share))
    framed = (cycle["nonadaptive"] * scale, pixel["nonadaptive"] * pixel_scale)
    rows.append(
        ("nonadaptive", f"{framed[0]:,.4g}", f"{framed[1]:,.4g}", f"{100 * cycle['nonadaptive'] / total:.1f} %")
    )
    header = ("stage", f"{unit} a cycle", f"{pixel_unit} an output pixel", "of a cycle")
    return Table(f"Ledger {name}", header, rows)


def advantage_table(summary: Mapping[str, Any]) -> Table:
    """Cycles per framed image under every ledger, and the settings at which the conclusion changes."""
    found, rows = summary["conclusion"], []
    for name, entry in summary["ledgers"].items():
        shown = (name, f"{entry['advantage']:.2f}")
        if name not in MODELLED:
            rows.append((*shown, "", "", "", ""))
            continue
        crossing = entry["crossing_batch"]
        changes = [f"- {batch} at {side}²" for batch, side in found["no_longer_admitted"][name]]
        changes += [f"+ {batch} at {side}²" for batch, side in found["newly_admitted"][name]]
        single, where = f"{entry['advantage_at_overdraw_1']:.2f}", "none" if crossing is None else f"{crossing:,.1f}"
        rows.append((*shown, single, where, str(len(entry["admitted"])), ", ".join(changes) or "same"))
    against = f"than under {summary['ledger']}"
    header = ("ledger", "cycles per image", "at overdraw 1", "crossing at batch", "admitted", f"other {against}")
    return Table("A cycle against an image", header, rows, _conclusion(summary))


def _conclusion(summary: Mapping[str, Any]) -> str:
    found, measurement = summary["conclusion"], summary["measurement"]
    less = ", ".join(found["cycle_costs_no_more"]) or "no ledger"
    more = ", ".join(found["cycle_costs_more"]) or "no ledger"
    changes = "changes" if found["changes"] else "does not change"
    parts = [f"The conclusion {changes} with the ledger: a cycle costs no more under {less}, more under {more}."]
    differ = [n for n in MODELLED if found["no_longer_admitted"][n] or found["newly_admitted"][n]]
    if differ:
        parts.append(f"What is admitted changes under {', '.join(differ)}.")
    if measurement:
        batch, side = (summary["config"]["measurement"][f"measured_{name}"] for name in ("batch", "resolution"))
        dearer = ", ".join(f"{b} at {r}²" for b, r in found["measured_dearer"]) or "none"
        parts.append(f"work and wall: batch {batch} at {side}² on this machine, rays counted.")
        parts.append(f"Settings at which a cycle took longer than an image: {dearer}.")
    return " ".join(parts)


def refit_table(measurement: Mapping[str, Any]) -> Table:
    """Seconds of a modelled operation of each stage on this machine."""

    def r2(value: float | None) -> str:
        return "" if value is None else f"{value:.3f}"

    rows = []
    for name, fit in measurement["refit"].items():
        line, affine = fit.origin, fit.affine
        origin = (f"{1e12 * line.per_unit:,.4g}", f"{fit.relative_to_tracing:,.3g}", r2(line.r2))
        fixed = ("", "", "", "")
        if affine is not None:
            fixed = (
                f"{1e12 * affine.per_unit:,.4g}",
                f"{1e3 * affine.offset:.3f}",
                r2(affine.r2),
                _percent(affine.worst),
            )
        rows.append((name, *origin, _percent(line.worst), *fixed))
    header = ("stage", "ps/FLOP", "x tracing", "R²", "worst", "ps/FLOP", "fixed, ms", "R²", "worst")
    note = (
        "Least squares over all settings, first through zero, then with a fixed cost per cycle (none where the model "
        "says the same for every setting). The model has nothing for the cache; one operation a sample is counted."
    )
    return Table("The model refitted to this machine", header, rows, note)


def setting_table(measurement: Mapping[str, Any]) -> Table:
    """Measured seconds and advantages at every setting."""
    rows = []
    for cell, row in zip(measurement["cells"], measurement["advantages"], strict=True):
        seconds = (cell.stage_s["tracing"], cell.stage_s["reconstruction"], cell.cycle_s, cell.image_s)
        ratios = (row[name] for name in ("modelled", "refitted_origin", "refitted", "measured"))
        where = (str(cell.batch_size), f"{cell.resolution_px}²", f"{cell.segments:.2f}")
        rows.append((*where, *(f"{1e3 * value:.1f}" for value in seconds), *(f"{value:.2f}" for value in ratios)))
    header = ("batch", "output", "segments", "tracing, ms", "recon., ms", "cycle, ms", "image, ms")
    header += ("model", "refit", "refit + fixed", "wall")
    note = (
        "The last four columns are cycles per framed image; the model takes the segments counted. Other programs "
        f"disturb the seconds: the machine's load before the measurement was {measurement['load_average']:.1f}."
    )
    return Table("Settings measured, medians", header, rows, note)


def growth_table(measurement: Mapping[str, Any]) -> Table:
    """Exponents of wall time, and straight lines beside them."""
    rows = []
    for name, law in measurement["exponents"].items():
        line = law.linear
        straight = (f"{1e3 * line.offset:.2f}", f"{line.r2:.4f}" if line.r2 is not None else "", _percent(line.worst))
        span, above = f"{law.low:,.0f} – {law.high:,.0f}", "" if law.above_fixed is None else f"{law.above_fixed:.3f}"
        rows.append((name.replace("_", " "), span, f"{law.exponent:.3f}", _percent(law.spread), above, *straight))
    header = ("wall time", "range", "exponent", "spread", "above a fixed cost", "line: fixed, ms", "R²", "worst")
    return Table("Growth: power law, and a straight line with a fixed cost", header, rows)


def memory_table(memory: Mapping[str, Any]) -> Table:
    """Resident memory of the long run."""

    def mib(name: str, sign: str = "") -> str:
        return f"{memory[name] / _MIB:{sign},.2f} MiB"

    rows = [
        ("before the pipeline", mib("before_bytes")),
        ("after the warm-up", mib("after_warmup_bytes")),
        ("greatest rise after the warm-up", mib("rise_after_warmup_bytes")),
        ("slope per 1000 cycles, all", mib("slope_bytes_per_1000_cycles", "+")),
        ("slope per 1000 cycles, without the first quarter", mib("slope_settled_bytes_per_1000_cycles", "+")),
        ("slope per 1000 cycles and output megapixel", mib("slope_bytes_per_1000_cycles_per_megapixel", "+")),
        ("of the pipeline, per output megapixel", mib("pipeline_bytes_per_megapixel")),
    ]
    title = f"Memory over {memory['cycles']} cycles, batch {memory['batch_size']} at {memory['resolution_px']}²"
    return Table(title, ("resident memory", ""), rows)


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"
