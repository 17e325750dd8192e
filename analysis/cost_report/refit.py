"""Lines and power laws through measured cost: the price of a stage's operation, and the growth of time and memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.metrics.cost_model import CostParameters, per_segment, stage_flops

MEGAPIXEL = 1e6
_ALIKE = 1e-6  # abscissas closer than this relative distance are one point, which determines no slope
_EXPONENTS = (0.1, 3.0)


@dataclass(frozen=True)
class Cell:
    """Measurements of one setting, medians over cycles.

    Attributes:
        batch_size, resolution_px: the setting.
        stage_s: seconds per cycle of each stage.
        cycle_s: seconds per cycle.
        segments: counted rays per sample.
        parameters: parameters of the cost model, with the counted segments.
        image_s, image_trace_s: seconds of a framed image of the same size, and of tracing it.
        image_segments: counted rays per sample of the framed image.
        cycles, images: numbers of measured cycles and images.
    """

    batch_size: int
    resolution_px: int
    stage_s: Mapping[str, float]
    cycle_s: float
    segments: float
    parameters: CostParameters
    image_s: float
    image_trace_s: float
    image_segments: float
    cycles: int
    images: int

    @property
    def flops(self) -> dict[str, float]:
        """Modelled operations per cycle of every stage that was measured.

        Deviation: the thesis counts nothing for storing framelets; here ``cache`` counts one operation per stored
        sample, so that its price can be fitted.
        """
        p = self.parameters
        flops = {name: float(value) for name, value in stage_flops(p).items()}
        return {**flops, "cache": float(p.batch_size * p.framelet_size)}

    @property
    def image_flops(self) -> float:
        """Modelled operations of the framed image, with the segments that were counted in it."""
        return float(self.parameters.recon_res * per_segment(self.parameters) * self.image_segments)


@dataclass(frozen=True)
class MemoryTrace:
    """Resident memory of the process over a run.

    Attributes:
        batch_size, resolution_px: setting of the run.
        before_bytes: memory with the scene loaded, before the pipeline starts.
        cycle: number of the cycle at each reading, the first at the end of the warm-up.
        resident_bytes: memory at each reading.
    """

    batch_size: int
    resolution_px: int
    before_bytes: int
    cycle: Sequence[int]
    resident_bytes: Sequence[int]


@dataclass(frozen=True)
class FittedLine:
    """Least-squares line.

    Attributes:
        per_unit: slope.
        offset: value at zero; 0 for a line through the origin.
        r2: coefficient of determination, always relative to the mean: below 0 the mean fits better. None if all
            values are equal.
        worst: greatest distance of a value from the line, as a share of the value.
    """

    per_unit: float
    offset: float
    r2: float | None
    worst: float

    def __call__(self, x: float) -> float:
        return self.offset + self.per_unit * x


@dataclass(frozen=True)
class PowerLaw:
    """Straight line on log-log axes.

    Attributes:
        exponent: its slope.
        factor: value at one.
        spread: relative standard deviation of the values about the line.
        low, high: range of the abscissa.
        above_fixed: exponent ``k`` of ``a + b x^k``, with the fixed value ``a`` fitted too; None below four values.
        linear: a straight line with an offset through the same values, for linear growth from a fixed cost.
    """

    exponent: float
    factor: float
    spread: float
    low: float
    high: float
    above_fixed: float | None
    linear: FittedLine


@dataclass(frozen=True)
class StageFit:
    """Seconds of a stage against its modelled operations.

    Attributes:
        flops, seconds: one value a setting.
        origin: line through the origin: seconds per operation.
        affine: line with a fixed cost per cycle; None if the operations hardly vary.
        relative_to_tracing: cost of an operation in units of a tracing operation (lines through the origin).
    """

    flops: Sequence[float]
    seconds: Sequence[float]
    origin: FittedLine
    affine: FittedLine | None
    relative_to_tracing: float

    @property
    def best(self) -> FittedLine:
        """The line with a fixed cost if it can be fitted, else the line through the origin."""
        return self.affine or self.origin


def _judged(x: np.ndarray, y: np.ndarray, per_unit: float, offset: float) -> FittedLine:
    left = y - (offset + per_unit * x)
    spread = float(((y - y.mean()) ** 2).sum())
    r2 = 1.0 - float((left**2).sum()) / spread if spread > 0.0 else None
    return FittedLine(per_unit, offset, r2, float(np.abs(left / y).max()))


def origin_line(x: Sequence[float], y: Sequence[float]) -> FittedLine:
    """Least squares through the origin."""
    a, b = np.asarray(x, float), np.asarray(y, float)
    return _judged(a, b, float(a @ b / (a @ a)), 0.0)


def affine_line(x: Sequence[float], y: Sequence[float]) -> FittedLine | None:
    """Least squares with an offset; None if the abscissas are equal."""
    a, b = np.asarray(x, float), np.asarray(y, float)
    if np.ptp(a) <= _ALIKE * np.abs(a).max():
        return None
    centred = a - a.mean()
    per_unit = float(centred @ (b - b.mean()) / (centred @ centred))
    return _judged(a, b, per_unit, float(b.mean() - per_unit * a.mean()))


def power_law(x: Sequence[float], y: Sequence[float]) -> PowerLaw:
    """Exponent with which ``y`` grows with ``x``, by least squares of the logarithms.

    Raises:
        ValueError: fewer than two different abscissas, or values that are not positive.
    """
    line = affine_line(x, y) if min(*x, *y) > 0.0 else None
    if line is None:
        raise ValueError(f"power_law: expected positive values at different abscissas, got {list(x)} and {list(y)}")
    log_x, log_y = np.log(x), np.log(y)
    exponent, offset = np.polyfit(log_x, log_y, 1)
    left = log_y - (offset + exponent * log_x)
    spread = float(np.sqrt((left**2).sum() / max(len(log_x) - 2, 1)))
    return PowerLaw(
        exponent=float(exponent),
        factor=float(np.exp(offset)),
        spread=float(np.expm1(spread)),
        low=min(x),
        high=max(x),
        above_fixed=_above_fixed(np.asarray(x, float), np.asarray(y, float)),
        linear=line,
    )


def _above_fixed(x: np.ndarray, y: np.ndarray) -> float | None:
    """Exponent ``k`` of ``y = a + b x^k`` with ``a, b >= 0``, by least squares of the relative residuals."""
    from scipy.optimize import fminbound, nnls

    if len(x) < 4:
        return None

    def distance(k: float) -> float:
        return nnls(np.stack((1.0 / y, (x / x.max()) ** k / y), axis=1), np.ones_like(y))[1]

    return float(np.asarray(fminbound(distance, *_EXPONENTS, xtol=1e-6)))


def refit(cells: Sequence[Cell]) -> dict[str, StageFit]:
    """Seconds per modelled operation of every stage over all settings."""
    flops = {name: [cell.flops[name] for cell in cells] for name in cells[0].stage_s}
    seconds = {name: [cell.stage_s[name] for cell in cells] for name in flops}
    origin = {name: origin_line(flops[name], seconds[name]) for name in flops}
    unit = origin["tracing"].per_unit
    return {
        name: StageFit(
            flops[name],
            seconds[name],
            origin[name],
            affine_line(flops[name], seconds[name]),
            origin[name].per_unit / unit,
        )
        for name in flops
    }


def exponents(cells: Sequence[Cell], centre: tuple[int, int]) -> dict[str, PowerLaw]:
    """Growth of wall time with the batch size, at the centre's output side, and with output pixels, at its batch."""
    by_batch = sorted((c for c in cells if c.resolution_px == centre[1]), key=lambda c: c.batch_size)
    by_side = sorted((c for c in cells if c.batch_size == centre[0]), key=lambda c: c.resolution_px)
    batches, pixels = [c.batch_size for c in by_batch], [c.resolution_px**2 for c in by_side]
    return {
        "tracing_by_batch": power_law(batches, [c.stage_s["tracing"] for c in by_batch]),
        "cycle_by_batch": power_law(batches, [c.cycle_s for c in by_batch]),
        "reconstruction_by_pixels": power_law(pixels, [c.stage_s["reconstruction"] for c in by_side]),
        "cycle_by_pixels": power_law(pixels, [c.cycle_s for c in by_side]),
    }


def advantages(cells: Sequence[Cell], fits: Mapping[str, StageFit]) -> list[dict[str, float]]:
    """Cycles per framed image at every setting: by the model, by the refitted model, and measured.

    ``modelled`` takes the counted segments. ``refitted`` prices each stage by its line with a fixed cost if there is
    one, ``refitted_origin`` by the line through the origin.
    """
    rows = []
    for cell in cells:
        flops = cell.flops
        modelled = sum(value for name, value in flops.items() if name != "cache")
        best = sum(fit.best(flops[name]) for name, fit in fits.items())
        origin = sum(fit.origin(flops[name]) for name, fit in fits.items())
        rows.append(
            {
                "batch_size": cell.batch_size,
                "resolution_px": cell.resolution_px,
                "modelled": cell.image_flops / modelled,
                "refitted_origin": fits["tracing"].origin(cell.image_flops) / origin,
                "refitted": fits["tracing"].best(cell.image_flops) / best,
                "measured": cell.image_s / cell.cycle_s,
            }
        )
    return rows


def memory_growth(trace: MemoryTrace) -> dict[str, Any]:
    """Slope of resident memory over the cycles, the greatest rise after the warm-up, and both per output megapixel.

    ``slope_settled`` leaves out the first quarter of the readings, in which allocators may still reserve memory.
    """
    cycle, resident = np.asarray(trace.cycle, float), np.asarray(trace.resident_bytes, float)
    megapixels = trace.resolution_px**2 / MEGAPIXEL
    settled = cycle >= cycle[0] + (cycle[-1] - cycle[0]) / 4

    def slope(keep: np.ndarray) -> float:
        line = affine_line(cycle[keep].tolist(), resident[keep].tolist())
        return 1000.0 * line.per_unit if line is not None else 0.0

    everything = slope(np.ones_like(settled))
    peak, start = float(resident.max()), float(resident[0])
    return {
        "batch_size": trace.batch_size,
        "resolution_px": trace.resolution_px,
        "cycles": int(cycle[-1]),
        "before_bytes": trace.before_bytes,
        "after_warmup_bytes": start,
        "peak_bytes": peak,
        "rise_after_warmup_bytes": peak - start,
        "slope_bytes_per_1000_cycles": everything,
        "slope_settled_bytes_per_1000_cycles": slope(settled),
        "pipeline_bytes_per_megapixel": (peak - trace.before_bytes) / megapixels,
        "slope_bytes_per_1000_cycles_per_megapixel": everything / megapixels,
    }
