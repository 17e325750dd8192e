"""Tables from the results of the map of workloads. They do not depend on the order of the runs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from analysis.command.console import Table
from analysis.workloads.runs import Run, Workload

PLACE = ["side_px", "image_hz", "sample_flops"]


@dataclass(frozen=True)
class RunResult:
    """A run and its mean squared error over the reference times; NaN if the run was not possible."""

    run: Run
    mse: float


def policy_table(results: Iterable[RunResult]) -> pd.DataFrame:
    """A line for each workload and policy: ``ratio`` is the geometric mean over inputs and repetitions of its error
    over that of the framed renderer, NaN if one is missing; ``least`` and ``most`` are the ratios of single runs."""
    errors: dict[Workload, dict[str, dict[tuple[str, int], float]]] = {}
    for one in results:
        run = one.run
        errors.setdefault(run.workload, {}).setdefault(run.policy, {})[run.input, run.repetition] = one.mse
    lines = []
    for workload, by_policy in errors.items():
        framed = by_policy.get("framed", {})
        for policy, found in by_policy.items():
            ratios = np.array([found.get(place, np.nan) / framed[place] for place in framed])
            lines.append({
                "side_px": workload.side_px,
                "image_hz": workload.image_hz,
                "sample_flops": workload.sample_flops,
                "policy": policy,
                "ratio": float(np.exp(np.log(ratios).mean())) if len(ratios) else np.nan,
                "least": float(ratios.min(initial=np.inf)) if len(ratios) else np.nan,
                "most": float(ratios.max(initial=0.0)) if len(ratios) else np.nan,
                "runs": int(np.isfinite(ratios).sum()),
            })  # fmt: skip
    return pd.DataFrame(lines)


def map_table(policies: pd.DataFrame) -> pd.DataFrame:
    """A line for each workload: the policy of least ratio, the second one, and their ratios."""
    found = []
    groups: Any = policies.dropna(subset=["ratio"]).groupby(PLACE, sort=False) if len(policies) else ()
    for place, group in groups:
        first, *others = group.sort_values("ratio", kind="stable").to_dict("records")
        second = others[0] if others else {"policy": "", "ratio": np.nan}
        found.append({
            **dict(zip(PLACE, place, strict=True)),
            "best": first["policy"],
            "ratio": first["ratio"],
            "second": second["policy"],
            "second ratio": second["ratio"],
        })  # fmt: skip
    return pd.DataFrame(found)


def paying_table(policies: pd.DataFrame) -> pd.DataFrame:
    """A line for each side, rate and policy: ``pays from`` is the price of a sample, FLOPs, from which on its error is
    at most that of the framed renderer, interpolated on logarithmic scales. It is the least measured price if the error
    always is, and infinite if it is not at the greatest price."""
    found = []
    groups: Any = policies.groupby(["side_px", "image_hz", "policy"], sort=False) if len(policies) else ()
    for (side, rate, policy), group in groups:
        if policy != "framed":
            line = group.sort_values("sample_flops")
            pays = pays_from(line["sample_flops"].to_numpy(), line["ratio"].to_numpy())
            found.append({"side_px": side, "image_hz": rate, "policy": policy, "pays from": pays})
    return pd.DataFrame(found)


def pays_from(flops: np.ndarray, ratio: np.ndarray) -> float:
    """The price from which on a ratio stays at most 1, for ascending prices; a missing ratio counts as above 1."""
    above = np.flatnonzero(~(ratio <= 1.0))
    if not len(above):
        return float(flops[0])
    last = above[-1]
    if last == len(flops) - 1:
        return float("inf")
    if not np.isfinite(ratio[last]):
        return float(flops[last + 1])
    high, low = np.log(ratio[last]), np.log(ratio[last + 1])
    share = high / (high - low)
    return float(np.exp(np.log(flops[last]) + share * np.log(flops[last + 1] / flops[last])))


def shown_tables(maps: pd.DataFrame, paying: pd.DataFrame) -> list[Table]:
    """The tables as text: a map for each side, and the price from which on each policy pays."""
    found = []
    for side in sorted(set(maps["side_px"])) if len(maps) else ():
        here: Any = maps[maps["side_px"] == side]
        prices = sorted(set(here["sample_flops"]))
        rows = []
        for rate in sorted(set(here["image_hz"]), reverse=True):
            cells = here[here["image_hz"] == rate].set_index("sample_flops")
            said = [_cell(cells.loc[price]) if price in cells.index else "—" for price in prices]
            rows.append([f"{rate:g}", *said])
        header = ["framed images a second", *(f"{price:g} FLOPs a sample" for price in prices)]
        found.append(Table(f"Least error and whose it is, over framed's, at {side:g} px", header, rows))
    if len(paying):
        rates = sorted(set(paying["image_hz"]), reverse=True)
        rows = []
        for (side, policy), group in paying.groupby(["side_px", "policy"], sort=False):  # type: ignore[misc]
            by_rate = dict(zip(group["image_hz"], group["pays from"], strict=True))
            rows.append([f"{side:g}", policy, *(_price(by_rate.get(rate, np.nan)) for rate in rates)])
        header = ["side, px", "policy", *(f"{rate:g} framed images a second" for rate in rates)]
        found.append(Table("Price of a sample, FLOPs, from which on a policy is better than framed", header, rows))
    return found


def _cell(line: Any) -> str:
    return f"{line['best']} {line['ratio']:.3f} ({line['second']} {line['second ratio']:.3f})"


def _price(value: float) -> str:
    return "—" if np.isnan(value) else "never" if np.isinf(value) else f"{value:,.0f}"
