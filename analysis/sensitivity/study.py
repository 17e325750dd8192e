"""How much the result depends on the error estimate's template and on the bias between space and time.

The slopes of the template are varied together, its offsets and the bias one at a time.

Source: Stephens 2011, sec. 7.3.2. Deviation: the thesis compares pictures of nine slope pairs of one input by eye; here
every input is also measured against the framed renderer, and offsets and bias are varied beside the slopes.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import tyro
from numpy.typing import NDArray

from analysis.command import limits
from analysis.command.cluster import ClusterOptions
from analysis.metrics.cost_model import Ledger
from analysis.study.cases import INPUTS, ROWS, SCALES, Case, framed_config
from tsar.config import TsarConfig, closed_choices, require

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]

ALL = "all inputs"
"""In place of an input: the geometric mean of the errors of all."""
BEST = ("to_default", "edge", "low", "high", "held_out", "beyond_spread")
"""Columns of the table of optima that say how good the best setting is; the others say how flat the sweep is."""
_FLAT = 1e-9
_DRAWS = 4000


@dataclass(frozen=True)
@closed_choices()
class SensitivityOptions:
    """Runs over a grid of spatial and temporal slopes, and over offsets and bias. Runs on disk are not repeated."""

    inputs: tuple[str, ...] = INPUTS
    """Built-in inputs."""
    row: int = 7
    """Row of table 7.2 that gives batch and resolution, 0 to 15; 7 is batch 128 at 512²."""
    scale: Literal["thesis", "half", "quick"] = "quick"
    """thesis: its resolution and batch. half: half the side, and a quarter of the samples, tiles and machine. quick: a
    quarter of the side, against a reference half as often."""
    spatial_slopes: tuple[float, ...] = (-2.0, -1.0, 0.0)
    """Spatial slopes of the grid, steepest first."""
    temporal_slopes: tuple[float, ...] = (-2.0, -1.0, 0.0)
    """Temporal slopes of the grid, steepest first."""
    offsets: tuple[float, ...] = (-4.0, -2.0, 0.0, 2.0, 4.0)
    """Added to the spatial offset and, in runs of their own, to the temporal one."""
    biases: tuple[float, ...] = (-2.0, -1.0, 0.0, 1.0, 2.0)
    """Biases, octaves; positive towards space."""
    repetitions: int = 1
    """Runs of each: repetition r has seed r and phase r / repetitions."""
    figure_input: str = "fast-crossing"
    """The input that is shown as pictures."""
    still_s: float = 0.65
    """When the pictures are taken, seconds after the start."""
    tsar: Annotated[TsarConfig, tyro.conf.arg(name=""), tyro.conf.OmitArgPrefixes] = field(default_factory=TsarConfig)
    """The default setting, marked by an asterisk; batch and resolution come from the row, seed from the repetition."""
    ledger: Ledger = "thesis"
    """How cost is counted; wall is refused, for it gives no result twice."""
    farm: Annotated[ClusterOptions, tyro.conf.arg(name=""), tyro.conf.OmitArgPrefixes] = field(
        default_factory=ClusterOptions
    )
    """Where the runs are made."""
    out: Path = Path("out/sensitivity")
    """Folder for the results."""
    cache: Path = Path(".cache/reference")
    """Folder for references, shared by all runs."""

    def __post_init__(self) -> None:
        require(set(self.inputs) <= set(INPUTS), "inputs", f"names out of {', '.join(INPUTS)}", self.inputs)
        for name in ("inputs", "spatial_slopes", "temporal_slopes"):
            require(len(getattr(self, name)) > 0, name, "at least one", getattr(self, name))
        for name in ("inputs", "spatial_slopes", "temporal_slopes", "offsets", "biases"):
            chosen = getattr(self, name)
            require(len(chosen) == len(set(chosen)), name, "none twice", chosen)
        require(0 <= self.row < len(ROWS), "row", f"a number from 0 to {len(ROWS) - 1}", self.row)
        slopes, changes = (-60.0, 60.0), (-120.0, 120.0)
        limits.within(self, spatial_slopes=slopes, temporal_slopes=slopes, offsets=changes, biases=(-8.0, 8.0))
        limits.within(self, repetitions=limits.REPETITIONS)
        require(self.figure_input in self.inputs, "figure_input", "one of the inputs", self.figure_input)
        seconds = SCALES[self.scale].seconds
        require(0 <= self.still_s < seconds, "still_s", f"a time within the run's {seconds:g} s", self.still_s)


@dataclass(frozen=True)
class Setting:
    """What is varied."""

    spatial_slope: float
    temporal_slope: float
    spatial_offset: float
    temporal_offset: float
    bias: float

    @classmethod
    def of(cls, tsar: TsarConfig) -> Setting:
        e = tsar.error
        return cls(e.spatial_slope, e.temporal_slope, e.spatial_offset, e.temporal_offset, tsar.response.bias)

    def changed(self, **values: float) -> Setting:
        # adding zero turns -0.0 into 0.0: equal settings must not have two names
        return dataclasses.replace(self, **{name: float(value) + 0.0 for name, value in values.items()})

    def applied(self, tsar: TsarConfig) -> TsarConfig:
        """The configuration at this setting."""
        values = dataclasses.asdict(self)
        response = dataclasses.replace(tsar.response, bias=values.pop("bias"))
        return dataclasses.replace(tsar, error=dataclasses.replace(tsar.error, **values), response=response)


AXES = {
    "slopes": ("spatial_slope", "temporal_slope"),
    "spatial offset": ("spatial_offset",),
    "temporal offset": ("temporal_offset",),
    "bias": ("bias",),
}
"""Sweeps, and what each varies."""


def sweeps(options: SensitivityOptions) -> dict[str, list[Setting]]:
    """Settings of every sweep; of the slopes, rows of temporal ones, each with the steepest spatial one first."""
    base = Setting.of(options.tsar)
    slopes = itertools.product(sorted(options.temporal_slopes), sorted(options.spatial_slopes))
    offsets = sorted(options.offsets)
    return {
        "slopes": [base.changed(spatial_slope=spatial, temporal_slope=temporal) for temporal, spatial in slopes],
        "spatial offset": [base.changed(spatial_offset=base.spatial_offset + change) for change in offsets],
        "temporal offset": [base.changed(temporal_offset=base.temporal_offset + change) for change in offsets],
        "bias": [base.changed(bias=bias) for bias in sorted(options.biases)],
    }


Line = dict[str, Any]
"""Of a table, by column."""
Results = Mapping[tuple[str, "Setting | None", int], "pd.DataFrame"]
"""Tables over the reference times by input, setting and repetition. Runs that failed are missing."""


@dataclass(frozen=True)
class Run:
    """A case and its place in the study; the framed renderer has no setting."""

    input: str
    setting: Setting | None
    repetition: int
    case: Case

    @property
    def place(self) -> tuple[str, Setting | None, int]:
        return self.input, self.setting, self.repetition


def runs(options: SensitivityOptions) -> list[Run]:
    """Every run once: the framed renderer, the default setting, and all others.

    Raises:
        ConfigError: a setting is out of range.
    """
    scale = SCALES[options.scale]
    row = scale.config(options.row, options.tsar)
    settings = dict.fromkeys([Setting.of(options.tsar), *itertools.chain(*sweeps(options).values())])
    framed, found = framed_config(row.resolution_px), []
    for repetition, name in itertools.product(range(options.repetitions), options.inputs):
        seeded = dataclasses.replace(row, seed=repetition)
        for setting in (None, *settings):
            case = Case(
                input=name,
                policy="tsar" if setting else "framed",
                tsar=setting.applied(seeded) if setting else framed,
                scale=scale,
                phase=repetition / options.repetitions,
                ledger=options.ledger,
                stills_s=(options.still_s,) if repetition == 0 else (),
            )
            found.append(Run(name, setting, repetition, case))
    return found


def errors(results: Results, name: str, settings: Sequence[Setting | None], repetitions: int) -> Floats:
    """Mean MSE ``(settings, repetitions)`` of an input, or ``ALL``; NaN where a run is missing."""
    if name == ALL:
        each = [errors(results, one, settings, repetitions) for one in {key[0]: None for key in results}]
        return np.exp(np.mean(np.log(each), 0))
    keys = itertools.product([name], settings, range(repetitions))
    found = [results[key]["mse"].mean() if key in results else np.nan for key in keys]
    return np.array(found, dtype=np.float64).reshape(len(settings), repetitions)


def setting_table(results: Results, options: SensitivityOptions) -> list[Line]:
    """One line per sweep, input and setting, over its repetitions; errors and ratios are NaN where a run is missing."""
    from analysis.metrics.quality import ratio, suitable_percentile

    default, lines = Setting.of(options.tsar), []
    for (sweep, settings), name in itertools.product(sweeps(options).items(), options.inputs):
        for setting in settings:
            ours, base, framed = errors(results, name, (setting, default, None), options.repetitions)
            line: Line = {"sweep": sweep, "input": name, **dataclasses.asdict(setting), "default": setting == default}
            line |= {"mse": ours.mean(), "to_default": ours.mean() / base.mean(), "ratio": ours.mean() / framed.mean()}
            each = ours / framed
            line |= {"ratio_least": each.min(), "ratio_most": each.max(), "ratio_median": np.nan}
            if not np.isnan(each).any():
                keys = [[(name, one, number) for one in (setting, None)] for number in range(options.repetitions)]
                values = np.concatenate([ratio(*(results[key]["mse"].to_numpy() for key in pair)) for pair in keys])
                line |= {"ratio_median": np.median(values), "suitable_percentile": suitable_percentile(values)}
            lines.append(line)
    return lines


def optimum_table(results: Results, options: SensitivityOptions) -> list[Line]:
    """The best setting of every sweep and input, how much better than the default it is, and how flat the sweep is."""
    default, lines = Setting.of(options.tsar), []
    names = (*options.inputs, ALL) if results else ()
    for (sweep, settings), name in itertools.product(sweeps(options).items(), names):
        found = errors(results, name, settings, options.repetitions)
        whole = [number for number, row in enumerate(found) if not np.isnan(row).any()]
        base = errors(results, name, (default,), options.repetitions)[0]
        if not whole or np.isnan(base).any():
            continue
        chosen = [settings[number] for number in whole]
        lines.append({"sweep": sweep, "input": name, **_optimum(found[whole], base, chosen, AXES[sweep])})
    return lines


def _optimum(found: Floats, base: Floats, settings: Sequence[Setting], axes: tuple[str, ...]) -> Line:
    mean, points = found.mean(1), np.array([[getattr(one, axis) for axis in axes] for one in settings])
    best = int(mean.argmin())
    line: Line = dict(zip(axes, points[best], strict=True))
    line |= {"to_default": mean[best] / base.mean(), "edge": edge(points[best], points, axes) or "inside"}
    near = int((mean <= 1.05 * mean[best]).sum())
    line |= {"worst_to_best": mean.max() / mean[best], "within_5_percent": near, "settings": len(mean)}
    line |= beyond_spread(found, base)
    return line | (bowl(points, mean) if len(axes) == 2 else {})


def beyond_spread(found: Floats, base: Floats) -> Line:
    """Whether the best of settings ``(settings, repetitions)`` beats the default ``(repetitions,)`` beyond the spread.

    ``held_out`` is the error, over the default's, of settings each chosen on the other repetitions: the best of many is
    partly luck. Both it and the bootstrap interval have to lie below 1. With one repetition nothing can be said.
    """
    count = len(base)
    if count == 1:
        return {"low": np.nan, "high": np.nan, "held_out": np.nan, "beyond_spread": "unknown"}
    best = found[found.mean(1).argmin()]
    drawn = np.random.default_rng(0).integers(0, count, (_DRAWS, count))
    low, high = np.percentile(best[drawn].mean(1) / base[drawn].mean(1), (2.5, 97.5))
    others = ((found.sum(1, keepdims=True) - found) / (count - 1)).argmin(0)
    held_out = found[others, np.arange(count)].mean() / base.mean()
    return {"low": low, "high": high, "held_out": held_out, "beyond_spread": "yes" if max(high, held_out) < 1 else "no"}


def edge(point: Floats, points: Floats, axes: Sequence[str]) -> str:
    """At which ends of what was varied a point lies; empty inside."""
    names, words = [], {True: ("steepest", "flattest"), False: ("least", "greatest")}
    for axis, value, column in zip(axes, point, points.T, strict=True):
        low, high = column.min() + _FLAT, column.max() - _FLAT
        if low < high and not low < value < high:
            names.append(f"{words[axis.endswith('slope')][int(value >= high)]} {axis.replace('_', ' ')}")
    return ", ".join(names)


def bowl(points: Floats, mse: Floats) -> Line:
    """Least-squares fit of ``ln mse`` by a quadratic of two slopes, and where on the grid it is least.

    Returns:
        Second derivatives, root mean square of what is left, whether it is convex, and its minimum: the place where it
        is convex and that lies within the grid, else the edge of the grid. Empty for less than a grid of 3 x 3.
    """
    (x, y), centre = (points - points.mean(0)).T, points.mean(0)
    terms = np.stack([np.ones_like(x), x, y, x * x / 2, x * y, y * y / 2], 1)
    if np.linalg.matrix_rank(terms) < 6 or not (mse > 0).all():
        return {}
    fitted = np.linalg.lstsq(terms, np.log(mse), rcond=None)[0]
    slope, second = fitted[1:3], np.array([[fitted[3], fitted[4]], [fitted[4], fitted[5]]])
    low, high = points.min(0) - centre, points.max(0) - centre
    found = {"curvature_spatial": fitted[3], "curvature_temporal": fitted[5], "curvature_mixed": fitted[4]}
    found |= {"residual": np.sqrt(np.square(np.log(mse) - terms @ fitted).mean())}
    found["convex"] = bool(np.linalg.eigvalsh(second)[0] > _FLAT)
    if found["convex"]:
        least = np.linalg.solve(second, -slope)
        if (least >= low - _FLAT).all() and (least <= high + _FLAT).all():
            return found | {"fit_spatial_slope": (least + centre)[0], "fit_temporal_slope": (least + centre)[1]}
    # on an edge one coordinate is fixed and the rest is a parabola; where it is not convex its end is least
    candidates = []
    for fixed, value in itertools.product((0, 1), (low, high)):
        free, at = 1 - fixed, value[fixed]
        steps = [low[free], high[free]]
        if second[free, free] > _FLAT:
            steps.append(np.clip(-(slope[free] + second[0, 1] * at) / second[free, free], low[free], high[free]))
        candidates += [(at, step) if fixed == 0 else (step, at) for step in steps]
    values = [slope @ one + one @ second @ one / 2 for one in np.array(candidates)]
    least = np.array(candidates[int(np.argmin(values))]) + centre
    return found | {"fit_edge": "flat" if np.ptp(np.log(mse)) < _FLAT else edge(least, points, AXES["slopes"])}
