"""Temporally and spatially adaptive rendering: the pipeline, and the policies that are compared with it.

It exports the names of its modules that others use; each is imported at its first access.
"""

from typing import TYPE_CHECKING

from tsar.lazy import lazily

if TYPE_CHECKING:
    from tsar.choices import NORMS as NORMS, RECONSTRUCTIONS as RECONSTRUCTIONS, SOLVERS as SOLVERS
    from tsar.clock import StageTimer as StageTimer, fixed_clock as fixed_clock
    from tsar.config import (
        ConfigError as ConfigError,
        ErrorConfig as ErrorConfig,
        ReconstructionConfig as ReconstructionConfig,
        ResponseConfig as ResponseConfig,
        TilingConfig as TilingConfig,
        TsarConfig as TsarConfig,
    )
    from tsar.named import Named as Named
    from tsar.policies import POLICIES as POLICIES
    from tsar.policy import (
        Moment as Moment,
        Picture as Picture,
        Policy as Policy,
        Price as Price,
        Setting as Setting,
        run as run,
        step as step,
    )
    from tsar.reconstruction import Reconstruction as Reconstruction
    from tsar.stages import REFERENCE as REFERENCE, Stages as Stages
    from tsar.types import (
        Densities as Densities,
        Errors as Errors,
        FrameletBatch as FrameletBatch,
        MapShown as MapShown,
        SampleBatch as SampleBatch,
        SampleMap as SampleMap,
        ShownImage as ShownImage,
        StepRecord as StepRecord,
        Tiling as Tiling,
    )

__getattr__, __dir__ = lazily(
    __name__,
    {
        "tsar.choices": "NORMS RECONSTRUCTIONS SOLVERS",
        "tsar.clock": "StageTimer fixed_clock",
        "tsar.config": "ConfigError ErrorConfig ReconstructionConfig ResponseConfig TilingConfig TsarConfig",
        "tsar.named": "Named",
        "tsar.policies": "POLICIES",
        "tsar.policy": "Moment Picture Policy Price Setting run step",
        "tsar.reconstruction": "Reconstruction",
        "tsar.stages": "REFERENCE Stages",
        "tsar.types": "Densities Errors FrameletBatch MapShown SampleBatch SampleMap ShownImage StepRecord Tiling",
    },
)
