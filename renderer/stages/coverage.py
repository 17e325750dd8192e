"""Which configurations the compiled stages were written for: the fields that they know, and of closed choices those
that they have. Whatever else the reference learns, a field or a choice, runs there until it is listed here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Literal

from tsar.config import TsarConfig

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
"""Records of the configuration by name, and what is known of each: a field's choices, or None for what is a number."""

_DEPENDS: Mapping[StageName, tuple[str, ...]] = {
    "observe": ("", "tiling", "error"),
    "respond": ("", "tiling", "response"),
    "decide": ("", "tiling"),
    "reconstruct": ("", "tiling", "reconstruction"),
    "account": ("", "tiling"),
}
"""What a stage reads of the configuration. To respond is a part of to decide, which goes on after it."""


def covers(config: TsarConfig, stage: StageName) -> bool:
    """Whether a compiled stage does what a configuration says; where not, that of the reference runs."""
    return all(_known(getattr(config, name) if name else config, _KNOWN[name]) for name in _DEPENDS[stage])


def _known(record: object, known: Mapping[str, tuple[str, ...] | None]) -> bool:
    names = {field.name for field in fields(record)}  # type: ignore[arg-type]
    choices = ((name, listed) for name, listed in known.items() if listed is not None)
    return names <= known.keys() and all(getattr(record, name) in listed for name, listed in choices)
