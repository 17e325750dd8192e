"""The cost model as a report: costs per stage under every ledger, the admitted set, the equal-cost surface, and the
model beside measurements on this machine."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from analysis.command.cli import bad_input, full_disk
from analysis.cost_report.measurement import measure, prepare
from analysis.cost_report.options import CostReportOptions, MeasurementOptions
from analysis.cost_report.refit import Cell
from analysis.cost_report.sweeps import admitted_rows, crossing_batch, sweep
from analysis.metrics.cost_model import (
    MODELLED,
    CostParameters,
    Ledger,
    adaptive_flops,
    advantage,
    naive_per_pixel,
    nonadaptive_flops,
    stage_flops,
)
from analysis.page.figures import save
from analysis.storage.files import atomic, write_json
from analysis.storage.results import SUMMARY, own_results

if TYPE_CHECKING:
    from pyvista import PolyData
    from torch import Tensor

    from analysis.cost_report.measurement import Measurement
    from analysis.cost_report.sweeps import ParameterSweep

SURFACE_BATCHES = (16.0, 1536.0)
SURFACE_SEGMENTS = (0.0, 8.0)
SURFACE_SIDES_PX = (64.0, 1536.0)
"""Intervals of fig. 7.6."""


def costs(p: CostParameters, ledger: Ledger) -> dict[str, Any]:
    """Operations per cycle of every stage and in total, and operations of a framed image."""
    stages = {name: float(value) for name, value in stage_flops(p, ledger).items()}
    adaptive = {**stages, "total": float(adaptive_flops(p, ledger))}
    return {"adaptive": adaptive, "nonadaptive": float(nonadaptive_flops(p, ledger))}


def per_pixel(cost: Mapping[str, Any], pixels: float) -> dict[str, Any]:
    """Costs of :func:`costs` per output pixel."""
    stages = {name: value / pixels for name, value in cost["adaptive"].items()}
    return {"adaptive": stages, "nonadaptive": cost["nonadaptive"] / pixels}


def _ledger_entry(cost: Mapping[str, Any], pixels: float, unit: str) -> dict[str, Any]:
    ratio = cost["nonadaptive"] / cost["adaptive"]["total"] if cost["nonadaptive"] else 0.0
    return {"unit": unit, "per_cycle": cost, "per_pixel": per_pixel(cost, pixels), "advantage": ratio}


def modelled_ledgers(options: CostReportOptions) -> dict[str, dict[str, Any]]:
    """Costs, admitted set and crossing under every modelled ledger."""
    p, found = options.parameters, {}
    single = dataclasses.replace(p, avg_recon_overdraw=1)
    for ledger in MODELLED:
        found[ledger] = {
            **_ledger_entry(costs(p, ledger), float(p.recon_res), "FLOP"),
            "advantage_at_overdraw_1": float(advantage(single, ledger)),
            "naive_per_pixel": float(naive_per_pixel(p, ledger)),
            "crossing_batch": crossing_batch(p, ledger),
            "admitted": admitted_rows(options.admitting, options.batches, options.resolutions, ledger),
        }
    return found


def measured_ledgers(cell: Cell) -> dict[str, dict[str, Any]]:
    """The ledgers ``work`` and ``wall`` at a measured setting; only ``wall`` has the stage ``cache``."""
    pixels = float(cell.resolution_px**2)
    work = {**costs(cell.parameters, "thesis"), "nonadaptive": cell.image_flops}
    # the sum of medians is not quite the median of sums: the total is the measured time of a cycle
    wall = {"adaptive": {**cell.stage_s, "total": cell.cycle_s}, "nonadaptive": cell.image_s}
    return {"work": _ledger_entry(work, pixels, "FLOP"), "wall": _ledger_entry(wall, pixels, "s")}


def conclusion(
    ledgers: Mapping[str, Mapping[str, Any]], chosen: str, settings: Sequence[Mapping[str, float]] = ()
) -> dict[str, Any]:
    """The ledgers and settings by which a cycle is cheaper than an image, and those by which it is not.

    Args:
        ledgers: entries by name.
        chosen: the ledger with which the admitted sets of the others are compared.
        settings: measured advantages.
    """
    cheaper = [name for name, entry in ledgers.items() if entry["advantage"] >= 1.0]
    dearer = [name for name in ledgers if name not in cheaper]
    admitted = {name: set(entry["admitted"]) for name, entry in ledgers.items() if "admitted" in entry}
    return {
        "cycle_costs_no_more": cheaper,
        "cycle_costs_more": dearer,
        "changes": bool(cheaper) and bool(dearer),
        "no_longer_admitted": {name: sorted(admitted[chosen] - rows) for name, rows in admitted.items()},
        "newly_admitted": {name: sorted(rows - admitted[chosen]) for name, rows in admitted.items()},
        "measured_dearer": [(s["batch_size"], s["resolution_px"]) for s in settings if s["measured"] < 1.0],
    }


def sweeps(options: CostReportOptions) -> dict[str, ParameterSweep]:
    """Cost per pixel along the three parameters of figs 7.3, 7.4 and 7.5."""
    import torch

    def line(low: float, high: float) -> Tensor:
        return torch.linspace(low, high, 481, dtype=torch.float64)

    axes = {
        "recon_res": torch.exp2(line(6, 11)) ** 2,
        "batch_size": line(1, SURFACE_BATCHES[1]),
        "trace_segments": line(0, 16),
    }
    p = options.parameters
    return {name: sweep(p, name, values, options.ledger) for name, values in axes.items()}


def advantages_by_batch(options: CostReportOptions) -> tuple[Tensor, dict[str, Tensor]]:
    """Batch sizes, and the cycles per framed image at each of them under every modelled ledger."""
    import torch

    batch = torch.exp2(torch.linspace(4, 11, 281, dtype=torch.float64))
    p = dataclasses.replace(options.parameters, batch_size=batch)
    return batch, {ledger: torch.as_tensor(advantage(p, ledger)) for ledger in MODELLED}


def equal_cost_surface(options: CostReportOptions, steps: int = 61) -> PolyData:
    """Points (batch size, segments, output side in pixels) at which a cycle costs as much as an image (fig. 7.6).

    ``ratio`` at each point is the nonadaptive over the adaptive cost there. The surface is the zero set of their
    difference, which is linear along two of the axes, so interpolation along them is exact.
    """
    import numpy as np
    import pyvista
    import torch

    p, ledger = options.parameters, options.ledger

    def at(batch: Tensor, segments: Tensor, side: Tensor) -> CostParameters:
        return dataclasses.replace(p, batch_size=batch, trace_segments=segments, recon_res=side**2)

    batch = torch.linspace(*SURFACE_BATCHES, steps, dtype=torch.float64)
    segments = torch.linspace(*SURFACE_SEGMENTS, steps, dtype=torch.float64)
    side = torch.linspace(*SURFACE_SIDES_PX, 4 * steps - 3, dtype=torch.float64)
    q = at(batch[:, None, None], segments[None, :, None], side[None, None, :])
    difference = (nonadaptive_flops(q, ledger) - adaptive_flops(q, ledger)) / p.framelet_size
    grid = pyvista.RectilinearGrid(batch.numpy(), segments.numpy(), side.numpy())
    grid.point_data["difference"] = torch.as_tensor(difference).numpy().ravel(order="F")
    surface = grid.contour([0.0], scalars="difference")
    assert isinstance(surface, pyvista.PolyData)
    surface.clear_data()
    ratio = torch.empty(0)
    if surface.n_points:
        points = torch.from_numpy(np.asarray(surface.points, np.float64))
        ratio = torch.as_tensor(advantage(at(*points.T), ledger))
    surface.point_data["ratio"] = ratio.numpy()
    return surface


def refitted(options: MeasurementOptions, measured: Measurement) -> dict[str, Any]:
    """The measurement, and the model's constants refitted to it."""
    from analysis.cost_report.refit import advantages, exponents, memory_growth, refit

    fits = refit(measured.cells)
    return {
        "refit": fits,
        "exponents": exponents(measured.cells, options.centre),
        "advantages": advantages(measured.cells, fits),
        "memory": memory_growth(measured.memory) if measured.memory else None,
        "ledgers": measured_ledgers(measured.centre(options)),
        **{item.name: getattr(measured, item.name) for item in dataclasses.fields(measured) if item.name != "memory"},
        "memory_trace": measured.memory,
    }


def summarise(options: CostReportOptions, measurement: Mapping[str, Any] | None) -> dict[str, Any]:
    """The results part of ``summary.json``."""
    ledgers = modelled_ledgers(options)
    chosen = ledgers[options.ledger]
    if measurement is not None:
        ledgers |= measurement["ledgers"]
    return {
        "ledger": options.ledger,
        "flops_per_cycle": chosen["per_cycle"],
        "flops_per_pixel": chosen["per_pixel"],
        "admitted": [list(row) for row in chosen["admitted"]],
        "advantage": {name: entry["advantage"] for name, entry in ledgers.items()},
        "advantage_at_overdraw_1": {name: ledgers[name]["advantage_at_overdraw_1"] for name in MODELLED},
        "crossing_batch": chosen["crossing_batch"],
        "conclusion": conclusion(ledgers, options.ledger, measurement["advantages"] if measurement else ()),
        "ledgers": ledgers,
        "measurement": measurement,
    }


_FILES = ("fig_7_*.png", "fig_7_6.vtp", "advantage.png", "refit.png", "scaling.png", "memory.png")


def write_report(options: CostReportOptions) -> dict[str, Any]:
    """Measures if asked to, and writes figures, the surface and the summary to ``options.out``.

    Returns:
        The content of ``summary.json``.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    with bad_input():
        own_results(options.out, _FILES)
    (options.out / SUMMARY).unlink(missing_ok=True)
    measured = None
    if options.measure:
        ready = prepare(options.measurement)
        from analysis.command import progress

        with progress.bars() as bars:
            measured = measure(options.measurement, ready, bars)
    from analysis.storage.summary import with_source

    found = refitted(options.measurement, measured) if measured else None
    machine: dict[str, Any] = {
        name: getattr(measured, name) if measured else None for name in ("device", "threads", "torch_threads")
    }
    scene = options.measurement.input if measured else None
    summary = with_source(summarise(options, found), options, scene=scene, **machine)
    with full_disk(options.out):
        _draw(options, summary)
        write_json(options.out / SUMMARY, summary)
    return summary


def _draw(options: CostReportOptions, summary: Mapping[str, Any]) -> None:
    """Figures of the model, and of the measurement if there is one."""
    from analysis.cost_report import plots

    out, measurement, title = options.out, summary["measurement"], f"ledger {options.ledger}"
    for number, found in enumerate(sweeps(options).values(), 3):
        crossing = summary["crossing_batch"] if found.name == "batch_size" else None
        save(plots.cost_figure(found, title, crossing), out / f"fig_7_{number}.png")
    measured = measurement["advantages"] if measurement else []
    at_side = [row for row in measured if row["resolution_px"] ** 2 == options.parameters.recon_res]
    save(plots.advantage_figure(*advantages_by_batch(options), at_side), out / "advantage.png")
    surface = equal_cost_surface(options)
    with atomic(out / "fig_7_6.vtp") as temporary:
        surface.save(temporary)
    rows = [(batch, options.admitted_segments, side) for batch, side in summary["admitted"]]
    limits = (SURFACE_BATCHES[1], SURFACE_SEGMENTS[1], SURFACE_SIDES_PX[1])
    plots.surface_picture(surface, rows, limits, out / "fig_7_6.png")
    if measurement:
        save(plots.refit_figure(measurement["refit"]), out / "refit.png")
        figure = plots.scaling_figure(measurement["cells"], measurement["exponents"], options.measurement.centre)
        save(figure, out / "scaling.png")
        if measurement["memory"]:
            save(plots.memory_figure(measurement["memory_trace"], measurement["memory"]), out / "memory.png")
