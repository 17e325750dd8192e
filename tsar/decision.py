"""The stages from a batch's errors to the next batch: new densities, their tiling, and the tiles that are due in it."""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Float64
from torch import Tensor

from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.response import respond
from tsar.selection import Request, request
from tsar.tiling import build
from tsar.types import Densities, Errors, Tiling


@dataclass(frozen=True)
class Decision:
    """New densities, the tiling they ask for, and the tiles that are due in it."""

    densities: Densities
    tiling: Tiling
    due: Request


def decide(
    densities: Densities, errors: Errors, history: Float64[Tensor, " e"], config: TsarConfig, timer: StageTimer
) -> Decision:
    """The response to the errors, the tiling and the selection, one after the other.

    Args:
        timer: receives the durations of ``response``, ``tiling`` and ``selection``.
    """
    with timer("response"):
        densities = respond(densities, errors, config)
    with timer("tiling"):
        tiling = build(densities.spatial, config)
    with timer("selection"):
        due = request(tiling, densities.temporal, history, config)
    return Decision(densities, tiling, due)
