"""The stages as the pipeline sees them: a record of functions, handed in as the renderer is.

The functions of this package are the reference: any tensor, any device, one operation a line. A compiled set computes
the same within rounding; where it does not cover a configuration it holds the function of the reference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from tsar.accounting import Account, account
from tsar.cache import FrameletCache
from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.observation import Observation, observe
from tsar.reconstruction import Reconstruction, reconstruct
from tsar.response import respond
from tsar.selection import Request, request
from tsar.tiling import build
from tsar.types import Densities, Errors, FrameletBatch, Tiling

Field = Float[Tensor, " e"]


@dataclass(frozen=True)
class Stages:
    """One function a stage; arguments and results are those of the reference, which is the default.

    Attributes:
        request: which tiles are due, and the request to the renderer.
        observe: errors of a batch; its colours and wavelet states into the cache, in place.
        respond: new densities.
        build: new tiling.
        reconstruct: image; flags dead framelets in the cache, in place.
        account: sums for the record of the cycle.
    """

    request: Callable[[Tiling, Field, Field, float, int, TsarConfig], Request] = request
    observe: Callable[[FrameletBatch, Tensor, FrameletCache, TsarConfig, StageTimer], Observation] = observe
    respond: Callable[[Densities, Errors, TsarConfig], Densities] = respond
    build: Callable[[Field, TsarConfig], Tiling] = build
    reconstruct: Callable[[FrameletCache, TsarConfig, float], Reconstruction] = reconstruct
    account: Callable[[Densities, Tensor, TsarConfig], Account] = account


REFERENCE = Stages()
"""Tensor operations throughout."""
