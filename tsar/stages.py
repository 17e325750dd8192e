"""The stages as the pipeline sees them: a record of functions, handed in as the renderer is.

The functions of this package are the reference: any tensor, any device, one operation a line. A compiled set computes
the same within rounding; where it does not cover a configuration it holds the function of the reference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from jaxtyping import Float64
from torch import Tensor

from tsar.accounting import Account, account
from tsar.cache import FrameletCache
from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.decision import Decision, decide
from tsar.filtering.stages import REFERENCE as FILTERING
from tsar.filtering.stages import FilterStages
from tsar.filtering.stages import reference as filtering_of
from tsar.observation import Observation, observe
from tsar.reconstruction import Reconstruction, reconstruct
from tsar.types import Densities, Errors, FrameletBatch

Field = Float64[Tensor, " e"]


@dataclass(frozen=True)
class Stages:
    """One function a group of stages; arguments and results are those of the reference, which is the default.

    Attributes:
        observe: errors of a batch; its colours and wavelet states into the cache, in place.
        decide: new densities, their tiling, and what is due in it.
        reconstruct: image; flags dead framelets in the cache, in place.
        account: sums for the record of the cycle.
        filtering: those of the policies ``filter`` and ``tsar``.
    """

    observe: Callable[[FrameletBatch, Tensor, FrameletCache, TsarConfig, StageTimer], Observation] = observe
    decide: Callable[[Densities, Errors, Field, TsarConfig, StageTimer], Decision] = decide
    reconstruct: Callable[[FrameletCache, TsarConfig, float], Reconstruction] = reconstruct
    account: Callable[[Densities, Errors, Tensor, TsarConfig], Account] = account
    filtering: FilterStages = FILTERING


REFERENCE = Stages()
"""Tensor operations throughout, for a picture that is a square of a power of two."""


def reference(config: TsarConfig) -> Stages:
    """Tensor operations throughout, for the picture of a configuration."""
    return Stages(filtering=filtering_of(config.window))
