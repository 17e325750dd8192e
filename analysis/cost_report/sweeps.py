"""The cost model over grids of parameters: admitted combinations, equal cost, and curves along one parameter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from analysis.metrics.cost_model import (
    CostParameters,
    Ledger,
    Value,
    adaptive_flops,
    admitted,
    nonadaptive_flops,
    stage_flops,
)

if TYPE_CHECKING:
    from torch import Tensor


def admitted_rows(
    p: CostParameters, batches: Sequence[int], sides_px: Sequence[int], ledger: Ledger = "thesis"
) -> list[tuple[int, int]]:
    """Batch size and output side of every admitted combination, sorted; one evaluation on the whole grid."""
    import torch

    batch = torch.tensor(sorted(set(batches)), dtype=torch.float64)
    side = torch.tensor(sorted(set(sides_px)), dtype=torch.float64)
    grid = admitted(replace(p, batch_size=batch[:, None], recon_res=side[None, :] ** 2), ledger)
    rows, columns = torch.nonzero(torch.as_tensor(grid), as_tuple=True)
    return [(int(b), int(r)) for b, r in zip(batch[rows].tolist(), side[columns].tolist(), strict=True)]


def crossing_batch(p: CostParameters, ledger: Ledger = "thesis", most: float = 2.0**20) -> float | None:
    """Batch size at which a cycle costs as much as a framed image, by bisection.

    Returns:
        The batch size; None if a cycle of one framelet costs more than an image, or one of ``most`` framelets less.
    """
    low, high = 1.0, most
    if not admitted(replace(p, batch_size=low), ledger) or admitted(replace(p, batch_size=high), ledger):
        return None
    while high - low > 1e-9 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if admitted(replace(p, batch_size=middle), ledger) else (low, middle)
    return low


@dataclass(frozen=True)
class ParameterSweep:
    """Operations per output pixel along the parameter ``name``; ``adaptive`` is the sum of the stages."""

    name: str
    values: Tensor
    stages: dict[str, Tensor]
    adaptive: Tensor
    nonadaptive: Tensor


def sweep(p: CostParameters, name: str, values: Tensor, ledger: Ledger = "thesis") -> ParameterSweep:
    """Cost per output pixel while one parameter takes every value of a tensor (figs 7.3 to 7.5)."""
    varied = replace(p, **{name: values})

    def per_pixel(cost: Value) -> Tensor:
        # stages that do not depend on the parameter give one number
        return cost / varied.recon_res * values.new_ones(values.shape)

    stages = {stage: per_pixel(cost) for stage, cost in stage_flops(varied, ledger).items()}
    adaptive, nonadaptive = adaptive_flops(varied, ledger), nonadaptive_flops(varied, ledger)
    return ParameterSweep(name, values, stages, per_pixel(adaptive), per_pixel(nonadaptive))
