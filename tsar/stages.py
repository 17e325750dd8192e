"""The stages as the pipeline calls them: a record of functions that is passed in, as the renderer is.

The functions of this package are the reference, tensor operations on any device. A compiled set computes the same up to
rounding; for a configuration that it does not cover it contains the function of the reference.
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
    """One function per group of stages; arguments and results are those of the reference, which is the default.

    Attributes:
        observe: estimates the errors of a batch and stores its colours and wavelet states in the cache, in place.
        decide: returns new densities, their tiling, and the tiles due in it.
        reconstruct: returns the image and flags dead framelets in the cache, in place.
        account: returns the sums for the record of the cycle.
        filtering: stages of the policies ``filter`` and ``tsar``.
        own_threads: whether the stages divide their work among threads of their own. Torch then uses one in a cycle:
            its operations between them are small, and its threads would wait on the cores that the stages use.
    """

    observe: Callable[[FrameletBatch, Tensor, FrameletCache, TsarConfig, StageTimer], Observation] = observe
    decide: Callable[[Densities, Errors, Field, TsarConfig, StageTimer], Decision] = decide
    reconstruct: Callable[[FrameletCache, TsarConfig, float], Reconstruction] = reconstruct
    account: Callable[[Densities, Errors, Tensor, TsarConfig], Account] = account
    filtering: FilterStages = FILTERING
    own_threads: bool = False


REFERENCE = Stages()
"""The reference, for a square picture whose side is a power of two."""


def reference(config: TsarConfig) -> Stages:
    """The reference, for the picture of a configuration."""
    return Stages(filtering=filtering_of(config.window))
