"""Configurations that the compiled stages cover: their fields, and the choices that are implemented. A new field or
choice of the reference runs there until it is listed here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from functools import lru_cache
from typing import Any, Literal

from tsar.config import TsarConfig
from tsar.filtering.options import FilterOptions
from tsar.filtering.stages import FilterStages

StageName = Literal["observe", "respond", "decide", "reconstruct", "account"]

_KNOWN: Mapping[str, Mapping[str, tuple[str, ...] | None]] = {
    "": dict.fromkeys(
        (
            *("batch_size", "resolution_px", "framelet_side", "sdf_side", "cache_size", "seed", "warmup_cycles"),
            *("width_px", "height_px", "tiling", "error", "response", "reconstruction"),
        )
    ),
    "tiling": dict.fromkeys(("level_min", "level_max", "rate_max", "tile_count_max", "threshold_samples")),
    "error": {
        **dict.fromkeys(("spatial_offset", "spatial_slope", "temporal_offset", "temporal_slope")),
        "norm": ("l2", "linf"),
        "form": ("contrast", "difference"),
        "octaves": ("greatest", "sum"),
        "extent": ("tile", "element"),
        "estimator": ("dwt",),
    },
    "response": {
        **dict.fromkeys(("gain", "bias", "surplus_max", "temporal_min")),
        "solver": ("waterfill",),
    },
    "reconstruction": {"age_support_px": None, "method": ("blend",)},
}
"""Covered fields of each record of the configuration, by name: the choices of a field, or None for numbers."""

_DEPENDS: Mapping[StageName, tuple[str, ...]] = {
    "observe": ("", "tiling", "error"),
    "respond": ("", "tiling", "response"),
    "decide": ("", "tiling"),
    "reconstruct": ("", "tiling", "reconstruction"),
    "account": ("", "tiling"),
}
"""Records of the configuration that a stage reads. ``respond`` is the first part of ``decide``."""

FilterStageName = Literal["chosen", "taken_in"]

_OPTIONS: Mapping[str, tuple[bool, ...] | None] = dict.fromkeys(
    (
        *("reprojection", "prediction", "smoothing", "accumulation", "jitter", "by_gain", "spread", "shadows"),
        *("probes", "noise", "latency_cycles", "wavelets", "share_max", "footprint"),
        *("life_min_s", "life_max_s", "reach", "memory_s"),
    )
)
_OPTIONS_OF: Mapping[FilterStageName, Mapping[str, tuple[bool, ...] | None]] = {
    "chosen": _OPTIONS,
    "taken_in": {**_OPTIONS, "wavelets": (False,)},
}
"""Covered options of the filter's stages that take options; values as in :data:`_KNOWN`."""


def covers(config: TsarConfig, stage: StageName) -> bool:
    """Whether a compiled stage covers a configuration; otherwise the stage of the reference runs."""
    return all(_known(getattr(config, name) if name else config, _KNOWN[name]) for name in _DEPENDS[stage])


@lru_cache(maxsize=64)
def covers_options(options: FilterOptions, stage: FilterStageName) -> bool:
    """Whether a compiled stage of the filter covers its options."""
    return _known(options, _OPTIONS_OF[stage])


def covered(compiled: FilterStages, reference: FilterStages) -> FilterStages:
    """Compiled stages of the filter that call the reference where they do not cover the options."""

    def choosing(stage: FilterStageName) -> Callable[..., Any]:
        """The stage, which takes its options last."""

        def of_options(*given: Any) -> Any:
            return getattr(compiled if covers_options(given[-1], stage) else reference, stage)(*given)

        return of_options

    return replace(compiled, chosen=choosing("chosen"), taken_in=choosing("taken_in"))


def _known(record: object, known: Mapping[str, tuple[object, ...] | None]) -> bool:
    names = {field.name for field in fields(record)}  # type: ignore[arg-type]
    choices = ((name, listed) for name, listed in known.items() if listed is not None)
    return names <= known.keys() and all(getattr(record, name) in listed for name, listed in choices)
