"""Tables of what a configuration selects by name: transport solvers, error norms and reconstructions.

The tables hold import paths, so that a name can be checked before any large module is imported.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tsar.named import Named

if TYPE_CHECKING:
    from torch import Tensor

    from tsar.cache import FrameletCache
    from tsar.config import TsarConfig
    from tsar.reconstruction import Reconstruction
    from tsar.response.transport import TransportSolver

    Norm = Callable[[Tensor, int], Tensor]
    Reconstruct = Callable[[FrameletCache, TsarConfig, float], Reconstruction]

SOLVERS: Named[TransportSolver] = Named(
    "solver",
    "tsar.solvers",
    {
        "waterfill": "tsar.response.transport:waterfill",
        "slow_greater": "tsar.response.transport:slow_greater",
        "scale_lesser": "tsar.response.transport:scale_lesser",
        "square": "tsar.response.transport:square",
        "descend": "tsar.response.transport:descend",
        "diffusion": "tsar.response.transport:diffusion",
        "trivial": "tsar.response.transport:trivial",
    },
)

NORMS: Named[Norm] = Named("norm", "tsar.norms", {"l2": "tsar.norms:total_power", "linf": "tsar.norms:greatest_power"})

RECONSTRUCTIONS: Named[Reconstruct] = Named(
    "reconstruction", "tsar.reconstructions", {"blend": "tsar.reconstruction:blend"}
)


def chosen(config: TsarConfig) -> tuple[tuple[Named[Any], str], ...]:
    """The tables of this module, each with the name that a configuration selects from it."""
    return (
        (SOLVERS, config.response.solver),
        (NORMS, config.error.norm),
        (RECONSTRUCTIONS, config.reconstruction.method),
    )
