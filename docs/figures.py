"""Draws the pictures of docs/concepts.md with the pipeline itself; a formula stands in for the ray tracer.

Usage: python docs/figures.py [FOLDER]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import torch
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PatchCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from torch import Tensor

from tsar import haar
from tsar.clock import fixed_clock
from tsar.config import TsarConfig
from tsar.error import compressed_luminance
from tsar.morton import deinterleave, raster_to_morton
from tsar.policies.thesis import Thesis
from tsar.policy import Setting, run
from tsar.response.local import Box, constrain
from tsar.response.mixture import mix
from tsar.selection import cell_centres
from tsar.types import Errors, FrameletBatch, SampleBatch, ShownImage, StepRecord, Tiling

CYCLE_S = 1 / 50
CYCLES = 40
ACCENT, MUTED, SECOND = "#c9570c", "0.55", "#1f6fb4"


def wheel(x: Tensor, y: Tensor, t: Tensor) -> Tensor:
    """A spoked wheel that rolls over a still, checked ground before a plain sky; linear RGB."""
    sky = torch.stack((0.35 + 0.1 * y, 0.5 + 0.1 * y, 0.75 - 0.1 * y), -1)
    checks = torch.sign(torch.sin(70.0 * x) * torch.sin(50.0 * (y - 0.65)))
    ground = (0.3 + 0.15 * checks)[..., None] * torch.tensor([1.0, 0.9, 0.75])
    picture = torch.where((y < 0.65)[..., None], sky, ground)
    dx, dy = x - 0.2 - 0.25 * t, y - 0.5
    radius, angle = torch.hypot(dx, dy), torch.atan2(dy, dx) - 1.25 * t
    rim = (radius < 0.2) & ((radius > 0.16) | (torch.sin(6.0 * angle) > 0.4))
    return torch.where(rim[..., None], torch.tensor([0.6, 0.08, 0.05]), picture)


def trace(batch: FrameletBatch) -> SampleBatch:
    """The formula in place of the ray tracer."""
    x, y = batch.position.unbind(-1)
    return SampleBatch(wheel(x, y, batch.times.to(torch.float32)).to(torch.float32), {"primary_rays": x.numel()})


def played(config: TsarConfig) -> list[tuple[StepRecord, ShownImage]]:
    """The cycles of a run."""
    return list(run(Thesis(Setting(config)), trace, fixed_clock(CYCLE_S), 0.4, 0.4 + CYCLES * CYCLE_S))


def raster(field: Tensor) -> np.ndarray:
    """A field over elements, from Morton order to rows."""
    side = round(field.numel() ** 0.5)
    return field[raster_to_morton(side)].reshape(side, side).numpy()


def encoded(image: Tensor) -> np.ndarray:
    """Linear RGB, encoded approximately as a display does."""
    return image.clamp(0.0, 1.0).pow(1 / 2.2).numpy()


def panels(columns: int, width: float, rows: int = 1) -> tuple[Figure, list]:
    """A figure of square panels without axes, row by row."""
    height = rows * (width / columns + 0.35 - 0.5 * (rows - 1))  # color bars narrow the panels of several rows
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axis in axes:
        axis.set(xticks=[], yticks=[])
    return figure, axes


def save(figure: Figure, path: Path) -> None:
    """Writes a small PNG without a date or a version in it."""
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=90, metadata={"Software": None}, pil_kwargs={"optimize": True})


def morton() -> Figure:
    """The Morton curve through a framelet, and through the tiles of a tiling."""
    figure, (left, right) = panels(2, 8.0)
    x, y = deinterleave(torch.arange(256))
    left.plot(x, y, color=MUTED, lw=0.9)
    left.scatter(x, y, s=9, c=np.arange(256), cmap="viridis", zorder=2)
    left.add_patch(Rectangle((3.5, -0.5), 4, 4, fill=False, ec=ACCENT, lw=2))
    left.set(title="256 samples of a framelet; a packet of 16", xlim=(-1, 16), ylim=(16, -1), aspect="equal")
    level = torch.tensor([1, 2, 2, 3, 3, 3, 3, 2, 1, 1])
    index = torch.tensor([0, 4, 5, 24, 25, 26, 27, 7, 2, 3])
    tiles(right, Tiling(level, index), np.arange(10), "viridis")
    x, y = deinterleave(index)
    size = 0.5 ** level.to(torch.float64)
    right.plot((x + 0.5) * size, (y + 0.5) * size, color="white", lw=1.5, marker="o", ms=4)
    right.set(title="the same curve through the tiles of a tiling")
    return figure


def tiles(axis, tiling: Tiling, values: np.ndarray, cmap: str) -> PatchCollection:
    """Tiles, each filled with its value."""
    x, y = deinterleave(tiling.index)
    size = (0.5 ** tiling.level.to(torch.float64)).tolist()
    places = zip(x.tolist(), y.tolist(), size, strict=True)
    boxes = [Rectangle((i * side, j * side), side, side) for i, j, side in places]
    drawn = axis.add_collection(PatchCollection(boxes, cmap=cmap, ec="black", lw=0.4))
    drawn.set_array(values)
    axis.set(xlim=(0, 1), ylim=(1, 0), aspect="equal")
    return drawn


def densities(record: StepRecord, display: ShownImage) -> Figure:
    """What is shown, both densities and the tiling of one cycle."""
    figure, axes = panels(2, 8.0, 2)
    axes[0].imshow(encoded(display.image))
    axes[0].set_title("what the display shows")
    fields = {
        "θs": (record.densities.spatial, "samples per element"),
        "θt": (record.densities.temporal, "refreshes per cycle"),
    }
    for axis, (name, (field, unit)) in zip(axes[2:], fields.items(), strict=True):
        drawn = axis.imshow(raster(field), cmap="magma", norm=LogNorm())
        figure.colorbar(drawn, ax=axis, shrink=0.8, label=unit)
        axis.set_title(f"{name}, {unit}")
    chosen = np.zeros(record.tiling.tile_count)
    chosen[record.selected.numpy()] = 1.0
    tiles(axes[1], record.tiling, chosen, "Oranges").set_clim(0, 1.6)
    axes[1].set_title(f"{record.tiling.tile_count} tiles, {len(record.selected)} rendered now")
    return figure


def errors(records: list[StepRecord]) -> Figure:
    """The newest error of every element, in space and in time."""
    figure, axes = panels(2, 7.5)
    for axis, name in zip(axes, ("spatial", "temporal"), strict=True):
        newest = torch.zeros_like(records[0].errors.spatial)
        for record in records:
            found = getattr(record.errors, name)
            newest = torch.where(record.errors.spatial != 0, found, newest)
        drawn = axis.imshow(raster(newest), cmap="RdBu_r", vmin=-1, vmax=1)
        axis.set_title({"spatial": "φs, error in space", "temporal": "φt, error in time"}[name])
    figure.colorbar(drawn, ax=axes, shrink=0.8, label="too many samples       too few samples")
    return figure


def ages(display: ShownImage) -> Figure:
    """The picture on the display, the age of its samples, and its difference from the truth at that time."""
    assert display.sample_map is not None
    figure, axes = panels(3, 9.0)
    side = display.image.shape[0]
    grid = (torch.arange(side) + 0.5) / side
    y, x = torch.meshgrid(grid, grid, indexing="ij")
    truth = wheel(x, y, torch.full_like(x, display.display_time_s))
    age = (display.display_time_s - display.sample_map.newest_s) / CYCLE_S
    axes[0].imshow(encoded(display.image))
    axes[0].set_title("reconstruction")
    drawn = axes[1].imshow(age.numpy(), cmap="cividis_r")
    figure.colorbar(drawn, ax=axes[1], shrink=0.8, label="cycles")
    axes[1].set_title("age of the newest samples")
    axes[2].imshow(np.abs(encoded(display.image) - encoded(truth)).mean(-1), cmap="gray_r", vmin=0, vmax=0.5)
    axes[2].set_title("difference from the truth")
    return figure


def octaves() -> Figure:
    """A framelet and two steps of its wavelet transform in space."""
    figure, axes = panels(3, 8.0)
    position = 0.36 + cell_centres(16) * 0.2
    x, y = position.unbind(-1)
    tile = compressed_luminance(wheel(x, y, torch.full_like(x, 0.7)))[None]
    first = haar.spatial_step(tile)
    second = torch.cat((haar.spatial_step(first[:, :64]), first[:, 64:]), 1)
    axes[0].imshow(raster(tile[0]), cmap="gray")
    axes[0].set_title("16 x 16 samples")
    for axis, field, title in ((axes[1], first, "one step"), (axes[2], second, "two steps")):
        axis.imshow(quadrants(field[0], 2 if field is second else 1), cmap="gray", vmin=0, vmax=1)
        axis.set_title(title)
    return figure


def quadrants(field: Tensor, steps: int) -> np.ndarray:
    """Coefficients laid out as one picture: low passes in the upper left corner, each part with its own contrast."""
    low, *details = field.chunk(4)
    plain = (raster(low) - float(low.min())) / float(low.max() - low.min() + 1e-9)
    corner = quadrants(low, steps - 1) if steps > 1 else plain
    scaled = [raster(part) / (2 * float(part.abs().max()) + 1e-9) + 0.5 for part in details]
    return np.block([[corner, scaled[1]], [scaled[0], scaled[2]]])


def response() -> Figure:
    """One element in the plane of its two densities: the direction of its error, and where a smaller grant takes it."""
    box, start = Box(1 / 64, 1 / 16), (0.3, 0.3)
    a_s, a_t = (torch.tensor([value], dtype=torch.float64) for value in start)
    asked = Errors(torch.tensor([0.4]), torch.tensor([0.25]))
    local = constrain(a_s, a_t, asked, box, 1.0)
    wanted = (a_s + local.k_min * local.m_s, a_t + local.k_min * local.m_t)
    figure = Figure(figsize=(6.4, 4.6), layout="constrained")
    axis = figure.subplots()
    axis.add_patch(
        Rectangle((box.spatial_min, box.temporal_min), 1 - box.spatial_min, 1 - box.temporal_min, fill=False)
    )
    s = np.linspace(0.02, 1.05, 400)
    for share, label in ((0.0, "θ before"), (0.4, "θ with 40 %\nof the change"), (1.0, "θ that is\nwanted")):
        change = local.desired_change * share
        product = float(a_s * a_t + change)
        axis.plot(s, product / s, color="0.45", lw=0.9, ls=("--", "-.", ":")[int(2 * share + 0.5)])
        axis.annotate(label, (1.05, product / 1.05), (5, 0), textcoords="offset points", va="center", fontsize=8)
        if 0 < share < 1:
            granted = mix(local, change, box, 0.0)
    axis.annotate("", [float(v) for v in wanted], start, arrowprops={"arrowstyle": "->", "color": ACCENT, "lw": 2})
    marks = {"a, before": (start, "0.3"), "b*, wanted": (wanted, ACCENT), "b, granted": (granted, SECOND)}
    for label, ((at_s, at_t), ink) in marks.items():
        axis.plot(float(at_s), float(at_t), "o", color=ink)
        axis.annotate(label, (float(at_s), float(at_t)), (14, 0), textcoords="offset points", va="center", color=ink)
    axis.set(xlim=(0, 1.05), ylim=(0, 1.05), xlabel="θs / greatest θs", ylabel="θt / greatest θt")
    return figure


def main() -> None:
    """Draws all pictures into a folder, docs/pictures unless one is named."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).parent / "pictures", help="destination")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    cycles = played(TsarConfig(batch_size=64, resolution_px=256))
    record, display = cycles[-1]
    figures = {
        "morton": morton(),
        "densities": densities(record, display),
        "errors": errors([record for record, _ in cycles]),
        "ages": ages(display),
        "octaves": octaves(),
        "response": response(),
    }
    for name, figure in figures.items():
        save(figure, folder / f"{name}.png")


if __name__ == "__main__":
    main()
