"""Cost of a run: operations by every ledger except ``wall``, counted work, and the latency of its pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from analysis.metrics.cost_model import MODELLED, CostParameters, control_flops, policy_flops, work_flops
from analysis.study.cases import Case
from analysis.study.runs import PolicyRun
from tsar.policy import Price

_ENLARGED = 9.0
"""Operations a display pixel to enlarge a picture: each of three channels blends two values along each axis."""


def cycle_flops(cost: CostParameters, price: Price, counters: Mapping[str, float]) -> dict[str, float]:
    """FLOPs of a cycle under every modelled ledger, and under ``work`` where its rays were counted.

    Args:
        cost: parameters of the model, with the overdraw of the mean cycle.
        price: price of a cycle of the policy.
        counters: work of the mean cycle by name; empty if none was counted.
    """
    found = {ledger: float(policy_flops(cost, price, ledger)) for ledger in MODELLED}
    if counters:
        # means of counts are not integers, but the price accepts them
        found["work"] = work_flops(cost, counters) + float(control_flops(cost, price))  # type: ignore[arg-type]
    return found


def spent(made: PolicyRun, case: Case) -> dict[str, Any]:
    """The cost of the measured span of a run whose stream has been consumed.

    Returns:
        ``flops`` by ledger, and ``counters``, over the whole span; ``cycles``; ``cycle_s``, the mean simulated time of
        a cycle; and ``latency_s``, from the beginning of a cycle to the display of its picture. Empty if no cycle began
        within the span.
    """
    totals, span_s = made.totals, case.scale.seconds
    if not totals.cycles or not totals.simulated_s:
        return {}
    cycle_s = totals.simulated_s / totals.cycles
    mean = {name: count / totals.cycles for name, count in totals.counters.items()}
    flops = cycle_flops(totals.of_a_cycle(case.cost), made.price, mean)
    share = case.tsar.resolution_px / case.shown_px
    shown = _ENLARGED * (1.0 + share) * case.shown_px**2 if share < 1.0 else 0.0
    return {
        "flops": {ledger: (value + shown) / cycle_s * span_s for ledger, value in flops.items()},
        "counters": {name: count / cycle_s * span_s for name, count in mean.items()},
        "cycles": totals.cycles,
        "cycle_s": cycle_s,
        "latency_s": made.latency_cycles * cycle_s,
    }
