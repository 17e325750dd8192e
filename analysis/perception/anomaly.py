"""Whether the point set explains the anomaly of stratified sampling at 216 samples a pixel.

In the thesis one random set serves a whole sequence: pixels and frames differ in their shifts alone, which average out
over a sequence, so a bad set would stay bad. Here several sets are drawn, each with several shifts, and the error of a
picture is divided into the part of the set and that of the shift.

Source: motion-blur perception thesis, chapter 5 (the anomaly) and figure 14 (one set for the whole rendering).
"""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy.typing import NDArray
from scipy import stats

from analysis.command.progress import Task
from analysis.perception.options import AnomalyOptions
from analysis.perception.psychometrics import correct_share
from analysis.perception.thesis_figures import RATE_HZ, SHUTTER_SHARE

_REFERENCE = 1 << 12  # samples a pixel
_JND, _OCTAVES = 80.0, 1.5  # threshold of the thesis' point sets, and width of the functions
SCENES = {"planescene": 80, "spheresscene": 33}
"""Scenes of the study, and the frame of each that is rendered."""


def errors(scene: str, options: AnomalyOptions, task: Task) -> dict[int, Float[NDArray[np.float64], "sets shifts"]]:
    """Mean squared errors of a frame, in encoded colour, by number of samples, for each set and shift."""
    from renderer.frames import render_image
    from renderer.sampling.plan import SamplePlan
    from renderer.trace import Renderer
    from scenes import catalog

    renderer, number = (
        Renderer(catalog.load(scene), threads=options.threads or None, seed=options.seed),
        SCENES[scene],
    )

    def picture(samples: int, kind: str, seed: int, shift: int) -> NDArray[np.float64]:
        plan = SamplePlan(samples, kind, seed, "gaussian", box_share=SHUTTER_SHARE)  # type: ignore[arg-type]
        size = options.width_px, options.width_px
        found = render_image(renderer, plan, *size, number / RATE_HZ, renderer.shutter_s, shift)
        return np.sqrt(np.clip(found.numpy().astype(np.float64), 0.0, 1.0))

    reference = picture(_REFERENCE, "owen", options.seed, 0)
    task.advance()
    made = {}
    for level in options.levels:
        rows = np.empty((options.sets, options.shifts))
        for one in range(options.sets):
            for shift in range(options.shifts):
                found = picture(level, "stratified", options.seed + one + 1, shift)
                rows[one, shift] = np.square(found - reference).mean()
            task.advance()
        made[level] = rows
    renderer.close()
    return made


def of_the_set(rows: Float[NDArray[np.float64], "sets shifts"]) -> tuple[float, float, float]:
    """Mean of the errors, and the standard deviations that sets and shifts cause, by a one-way analysis of variance.

    Source: Searle et al. 1992, "Variance Components", sec. 3.5.
    """
    count = rows.shape[1]
    within = float(rows.var(axis=1, ddof=1).mean())
    between = max(float(rows.mean(axis=1).var(ddof=1)) - within / count, 0.0)
    return float(rows.mean()), float(np.sqrt(between)), float(np.sqrt(within))


def table(made: dict[int, NDArray[np.float64]], scene: str) -> pd.DataFrame:
    """A row for each number of samples but the first: how much sets differ, and how likely a set is as bad as the mean
    set of the next lower number."""
    rows, levels = [], sorted(made)
    for lower, level in itertools.pairwise(levels):
        mean, of_sets, of_shifts = of_the_set(made[level])
        below = float(made[lower].mean())
        away = (below - mean) / of_sets if of_sets > 0.0 else np.nan
        rows.append(
            {
                "scene": scene, "samples": level, "mse": mean, "lower": lower, "mse_lower": below,
                "set_share": of_sets / mean, "shift_share": of_shifts / mean, "deviations": away,
                "chance": float(stats.norm.sf(away)),
            }
        )  # fmt: skip
    return pd.DataFrame(rows)


def chance_rises(options: AnomalyOptions) -> dict[float, float]:
    """Shares of studies with a falling psychometric function in which the share of right answers at some level from 64
    samples on is higher by at least 0.05 or 0.1 than at the level below it, for one of three point sets.

    A set has 12 observers with 8 answers at each level and a threshold of 80 samples, as in the thesis.

    Args:
        options: number of studies, and seed.
    """
    levels = np.array([64, 125, 216, 343, 512], np.float64)
    share = correct_share(levels, float(np.log2(_JND)), _OCTAVES, 0.0)
    rng = np.random.default_rng([options.seed, 0x216])
    found = rng.binomial(12 * 8, share, (options.studies, 3, len(levels))) / (12 * 8)
    rise = np.diff(found, axis=2).max(axis=(1, 2))
    return {least: float((rise >= least - 1e-12).mean()) for least in (0.05, 0.1)}


def described(rows: pd.DataFrame, rises: dict[float, float]) -> str:
    """A line for each row of :func:`table`, and for each share of studies."""
    lines = [
        f"{row['scene']}, {row['samples']:.0f} samples: sets differ by {100 * row['set_share']:.1f} % of the error, "
        f"shifts by {100 * row['shift_share']:.1f} %; "
        + (
            f"one as bad as the mean set of {row['lower']:.0f} is {row['deviations']:.1f} deviations away"
            if row["deviations"] == row["deviations"]
            else "sets differ by no more than the shifts do by chance"
        )
        for row in rows.to_dict("records")
    ]
    lines += [f"a curve rises by {least:g} or more in {100 * one:.0f} % of studies" for least, one in rises.items()]
    return "\n".join(lines)
