"""Adaptive and framed rendering, judged by the same observer: the batch sizes at which a difference is noticed."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.command.cli import InputError, require_unbroken
from analysis.command.cluster import ClusterOptions
from analysis.command.progress import Task
from analysis.perception.observers import Observer, correct_probability
from analysis.perception.options import AdaptiveOptions
from analysis.perception.psychometrics import THRESHOLD
from analysis.study.cases import ROWS, SCALES, Case, framed_config, is_framed
from analysis.study.evaluation import Resources, broken, finished
from analysis.study.farm import describe_failures, run_cases
from tsar.config import TsarConfig

SIDE_PX = 512
"""Output side of the rows of table 7.2 that are compared, before the scale divides it."""


def scores(options: AdaptiveOptions, task: Task) -> pd.DataFrame:
    """JOD from the reference of both policies at equal cost, a row for each input and batch size.

    Results and references are kept as in the other studies, so that this continues where it was stopped.

    Raises:
        InputError: a run failed.
        BrokenInvariants: a run broke an invariant.
    """
    scale = SCALES[options.scale]
    rows = [number for number, (_, side) in enumerate(ROWS) if side == SIDE_PX]
    cases: dict[tuple[str, int, str], Case] = {}
    for name in options.inputs:
        for row in rows:
            config = scale.config(row, TsarConfig(seed=options.seed))
            framed = framed_config(config.resolution_px)
            own = framed if is_framed(options.policy) else config
            for policy, chosen in ((options.policy, own), ("framed", framed)):
                case = Case(name, policy, chosen, scale, jod_span_s=options.jod_span_s, display=options.display)
                cases[name, row, policy] = case
    place = Resources(options.out / "runs", Path(options.references))
    keys, failures = run_cases(list(cases.values()), place, ClusterOptions(options.workers), task)
    if failures:
        for line in describe_failures({case.name: reason for case, reason in failures.items()}):
            print(line, file=sys.stderr)
        raise InputError(f"{len(failures)} runs failed; the same command makes what is missing")
    found = {at: finished(keys[case], place) for at, case in cases.items()}
    require_unbroken(broken(found.values()))
    table = []
    for name in options.inputs:
        for row in rows:
            own, framed = (_distance(found[name, row, policy]) for policy in (options.policy, "framed"))
            line = {"input": name, "policy": options.policy, "batch": ROWS[row][0]}
            table.append({**line, "jod_policy": own, "jod_framed": framed})
    return pd.DataFrame(table).sort_values(["input", "batch"], ignore_index=True)


def _distance(result: dict[str, Any] | None) -> float:
    score = None if result is None else result.get("jod")
    return float("nan") if score is None else 10.0 - float(score)


def judged(table: pd.DataFrame, sigma: float) -> pd.DataFrame:
    """The judgements of a simulated observer without lapses.

    Adds the probability of a right answer in the dual-pair task for each renderer against the reference, and the
    probability of preferring the policy to the framed renderer: of two stimuli with noise ``sigma`` each, the observer
    prefers the one that looks nearer to the reference.
    """
    from scipy import stats

    plain = Observer("ideal", 1.0, 0.0)
    policy, framed = (table[f"jod_{name}"].to_numpy(np.float64) for name in ("policy", "framed"))
    return table.assign(
        noticed_policy=correct_probability(policy, plain, sigma),
        noticed_framed=correct_probability(framed, plain, sigma),
        policy_preferred=stats.norm.cdf((framed - policy) / (np.sqrt(2.0) * sigma)),
    )


def thresholds(table: pd.DataFrame) -> pd.DataFrame:
    """For each input the batch sizes at which the policy differs noticeably from the reference, and those at which it,
    or the framed renderer, is preferred in three of four pairs."""
    rows = []
    for name in dict.fromkeys(table["input"]):
        part = table.loc[table["input"] == name]
        batch = part["batch"].to_numpy()
        preferred = part["policy_preferred"].to_numpy(np.float64)
        rows.append(
            {
                "input": name,
                "noticed_at": _listed(batch[part["noticed_policy"].to_numpy(np.float64) >= THRESHOLD]),
                "framed_noticed": bool((part["noticed_framed"] >= THRESHOLD).any()),
                "preferred_at": _listed(batch[preferred >= THRESHOLD]),
                "framed_preferred_at": _listed(batch[preferred <= 1.0 - THRESHOLD]),
            }
        )
    return pd.DataFrame(rows)


def _listed(values: Any) -> str:
    return ", ".join(str(int(value)) for value in values) or "none"
