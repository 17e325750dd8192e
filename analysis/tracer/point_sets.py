"""Evenness of point sets, and convergence of integrals sampled with them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy.typing import NDArray
from scipy.stats import qmc

from analysis.command.progress import Task
from analysis.tracer.options import PointSetOptions

if TYPE_CHECKING:
    from torch import Tensor

SETS = ("hammersley", "stratified", "poisson", "halton", "sobol", "owen", "random")
INTEGRANDS = ("static edge", "moving edge", "smooth")
Points = Float[NDArray[np.float64], "n 3"]


def evenness(points: Points) -> dict[str, float]:
    """Measures of one set of ``n`` points ``(u, v, t)``.

    Returns:
        ``discrepancy`` and those of its projections: the L2 star discrepancy (the root of scipy's value); ``distance``:
        least distance round the torus over that of the densest packing; ``distance_uv``: the same for the projection on
        the pixel, over that of the hexagonal packing; ``cells``: share of the ``n`` cells of a cubic grid that contain
        exactly one point; ``strata``: share of ``n`` equal intervals that do, mean over the axes.
    """
    from renderer.sampling.point_sets import packing_distance

    count, side = len(points), round(len(points) ** (1 / 3))
    found = {"discrepancy": _discrepancy(points)}
    for name, axes in (("uv", (0, 1)), ("ut", (0, 2)), ("vt", (1, 2)), ("u", (0,)), ("v", (1,)), ("t", (2,))):
        found[f"discrepancy_{name}"] = _discrepancy(points[:, axes])
    found["distance"] = _least_distance(points) / packing_distance(count)
    found["distance_uv"] = _least_distance(points[:, :2]) / math.sqrt(2.0 / (math.sqrt(3.0) * count))
    cell = np.floor(points * side).astype(np.int64) @ np.array([side * side, side, 1])
    found["cells"] = float((np.bincount(cell, minlength=count) == 1).mean())
    strata = np.floor(points * count).astype(np.int64)
    found["strata"] = float(np.mean([(np.bincount(strata[:, axis], minlength=count) == 1).mean() for axis in range(3)]))
    return found


def _discrepancy(points: Float[NDArray[np.float64], "n d"]) -> float:
    return float(qmc.discrepancy(points, method="L2-star"))


def _least_distance(points: Float[NDArray[np.float64], "n d"]) -> float:
    """Least distance round the torus; for a single point the distance to its own image."""
    if len(points) == 1:
        return 1.0
    apart = np.abs(points[:, None] - points[None])
    apart = np.minimum(apart, 1.0 - apart)
    distance = np.sqrt((apart**2).sum(axis=-1))
    np.fill_diagonal(distance, np.inf)
    return float(distance.min())


def half_space_volume(
    normal: Float[NDArray[np.float64], "cases d"], offset: Float[NDArray[np.float64], " cases"]
) -> Float[NDArray[np.float64], " cases"]:
    """Volume of the unit cube where ``normal · x <= offset``; no component of a normal is 0.

    Source: Barrow and Smith 1979, "Spline notation applied to a volume problem".
    """
    # x -> 1 - x makes a negative component positive
    dimensions = normal.shape[1]
    shifted, size = offset - np.minimum(normal, 0.0).sum(axis=1), np.abs(normal)
    total = np.zeros(len(normal))
    for corner in itertools.product((0, 1), repeat=dimensions):
        sign = (-1) ** sum(corner)
        total += sign * np.maximum(shifted - size @ np.array(corner, np.float64), 0.0) ** dimensions
    return np.clip(total / (math.factorial(dimensions) * size.prod(axis=1)), 0.0, 1.0)


@dataclass(frozen=True)
class Integrands:
    """Integrands of one kind over the unit cube, one row each, and their integrals."""

    values: Callable[[Float[NDArray[np.float64], "cases n 3"]], Float[NDArray[np.float64], "cases n"]]
    integral: Float[NDArray[np.float64], " cases"]


def integrands(kind: str, cases: int, rng: np.random.Generator) -> Integrands:
    """Edges at random angles and places that cross the pixel, static or moving by up to two pixels while the shutter is
    open; or products of sines of random phase."""
    if kind == "smooth":
        phase = rng.random((cases, 1, 3))
        waves = lambda points: (1.0 + 0.5 * np.sin(2.0 * np.pi * (points + phase))).prod(axis=-1)  # noqa: E731
        return Integrands(waves, np.ones(cases))
    angle = rng.uniform(0.0, 2.0 * np.pi, cases)
    speed = rng.uniform(0.1, 2.0, cases) if kind == "moving edge" else np.full(cases, 1e-9)
    normal = np.stack([np.cos(angle), np.sin(angle), speed], axis=1)
    low = np.minimum(normal, 0.0).sum(axis=1)
    offset = low + rng.random(cases) * np.abs(normal).sum(axis=1)
    inside = lambda points: (points @ normal[:, :, None])[..., 0] <= offset[:, None]  # noqa: E731
    flat = normal[:, :2] if kind == "static edge" else normal
    return Integrands(inside, half_space_volume(flat, offset))


def squared_error(points: Points, found: Integrands, shifts: Float[NDArray[np.float64], "cases 3"]) -> float:
    """Mean squared error over the integrands, each with its own shift of the points."""
    moved = points[None] + shifts[:, None]
    moved -= np.floor(moved)
    return float(((found.values(moved).mean(axis=1) - found.integral) ** 2).mean())


def measure(options: PointSetOptions, task: Task) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables of evenness, and of errors by integrand, with a row for each set and level."""
    from renderer.sampling.point_sets import point_set

    even, errors = [], []
    for name, level in itertools.product(SETS, sorted(set(options.levels))):
        sets = [point_set(name, level, options.seed + number) for number in range(options.sets_of_each)]  # type: ignore[arg-type]
        rows = pd.DataFrame([evenness(points) for points in sets])
        even.append({"set": name, "points": level, **rows.mean().to_dict()})
        for kind in INTEGRANDS:
            rng = np.random.default_rng([options.seed, INTEGRANDS.index(kind), level])
            found = integrands(kind, options.cases, rng)
            shifts = rng.random((options.cases, 3))
            mse = float(np.mean([squared_error(points, found, shifts) for points in sets]))
            errors.append({"set": name, "points": level, "integrand": kind, "mse": mse, "rmse": math.sqrt(mse)})
        task.advance()
    return pd.DataFrame(even), pd.DataFrame(errors)


def mean_errors(errors: pd.DataFrame, points: int) -> pd.DataFrame:
    """Mean squared errors at one number of points, with a column for each integrand."""
    some = errors.query("points == @points")
    return some.pivot(index="set", columns="integrand", values="mse").loc[list(SETS)].reset_index()


def slopes(errors: pd.DataFrame) -> pd.DataFrame:
    """Exponents of the mean squared error against the number of points, fitted over all levels above 1."""
    rows: list[dict[str, Any]] = []
    for name, kind in itertools.product(SETS, INTEGRANDS):
        part = errors[(errors["set"] == name) & (errors["integrand"] == kind) & (errors["points"] > 1)]
        slope = np.polyfit(np.log(np.asarray(part["points"])), np.log(np.maximum(np.asarray(part["mse"]), 1e-300)), 1)[
            0
        ]
        rows.append({"set": name, "integrand": kind, "slope": float(slope)})
    return pd.DataFrame(rows).pivot(index="set", columns="integrand", values="slope").loc[list(SETS)].reset_index()


def blurred_frames(
    options: PointSetOptions, sets: Sequence[str], levels: Sequence[int]
) -> dict[tuple[str, int], Tensor]:
    """One frame of the spheres scene by set and level, as in figure 5 of the thesis."""
    from renderer.frames import render_image
    from renderer.sampling.plan import SamplePlan
    from renderer.trace import Renderer
    from scenes import catalog

    renderer = Renderer(catalog.load("spheresscene"), seed=options.seed)
    frames = {}
    for name, level in itertools.product(sets, levels):
        plan = SamplePlan(level, name, options.seed, "gaussian", box_share=0.5)  # type: ignore[arg-type]
        size = options.frame_px, options.frame_px
        frames[name, level] = render_image(renderer, plan, *size, 33.0 / 30.0, renderer.shutter_s, 33)
    renderer.close()
    return frames
