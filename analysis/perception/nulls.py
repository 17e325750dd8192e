"""How often tests find a difference between conditions that do not differ."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from analysis.perception.analysis import comparisons, population_mu
from analysis.perception.options import RecoverOptions
from analysis.perception.psychometrics import correct_share, paired
from analysis.tracer.options import LEVELS

_SETS = ("hammersley", "stratified", "poisson")
_LEVEL = 0.05


def false_positives(
    options: RecoverOptions, spread: float, advance: Callable[[], object] = lambda: None
) -> dict[str, Any]:
    """Share of tests of two scenes below 5 % if neither is harder.

    Every observer has a threshold for each scene, whose logarithms are drawn independently about one mean, and the same
    answers in each of three point sets. So some find one scene harder and some the other.

    Args:
        options: observers, answers and studies; the first threshold, width and lapse rate count.
        spread: standard deviation of the thresholds, octaves.
        advance: called after each study.

    Returns:
        ``by_observer``, the share of tests with one entry per observer, as of
        :func:`analysis.perception.analysis.comparisons`; ``by_cell``, that of tests with one entry per observer and
        point set, as in the thesis; and the number of the former. A share of no tests is NaN.
    """
    jnd, sigma, lapse = options.jnds[0], options.sigmas[0], options.lapses[0]
    mu, people, answers = population_mu(jnd, sigma, lapse, spread), options.observers, max(options.answers // 3, 1)
    index = pd.MultiIndex.from_product(
        [[f"s{one:02d}" for one in range(people)], ["a", "b"], _SETS, LEVELS],
        names=["observer", "scene", "point_set", "samples"],
    )
    cells = index.to_frame(index=False).assign(time_filter="box")
    person = cells.groupby(["observer", "scene"]).ngroup().to_numpy()
    levels = cells["samples"].to_numpy(np.float64)
    found: dict[str, list[float]] = {"by_observer": [], "by_cell": []}
    for number in range(options.experiments):
        rng = np.random.default_rng([options.seed, number, 1])
        own = mu + spread * rng.standard_normal(2 * people)
        share = correct_share(levels, own[person], sigma, lapse)
        trials = cells.assign(correct=rng.binomial(answers, share) / answers)
        tested = comparisons(trials)
        found["by_observer"] += tested.loc[tested["of"] == "scene", "p"].dropna().tolist()
        for _, level in trials.groupby("samples"):
            both = paired(*level.pivot_table("correct", ["observer", "point_set"], "scene").to_numpy().T.tolist())
            found["by_cell"] += [] if both is None else [both.p]
        advance()
    shares = {name: float(np.mean(np.array(values) < _LEVEL)) if values else math.nan for name, values in found.items()}
    return {"spread": spread, "tests": len(found["by_observer"]), **shares}


def described(row: dict[str, Any]) -> str:
    """One line of text of a result."""
    equal = f"equal scenes, thresholds {row['spread']:g} octaves apart"
    if not row["tests"]:
        return f"{equal}: no test, which needs two observers whose answers differ"
    return (
        f"{equal}: of {row['tests']} tests, "
        f"{100 * row['by_observer']:.1f} % are below 5 % with one entry an observer, "
        f"{100 * row['by_cell']:.1f} % with one an observer and point set"
    )
