"""What can be laid over the picture of a side, and the pixels of both together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from analysis.live.runner import DisplayState
from analysis.metrics.quality import encode
from analysis.page.pictures import (
    RATE_MAP,
    ByteMap,
    ColorScale,
    PagePixels,
    age_map,
    density_map,
    enlarge,
    number,
    palette,
    stored,
    tiling_map,
)
from analysis.page.video import AGES, Scales
from tsar.config import TsarConfig

PLAIN = "none"
TILING, SPATIAL, TEMPORAL = "tiling by refresh rate", "spatial density", "temporal density"
EXPECTED = "expected error"
"""The map of :class:`tsar.policies.filter.Filter` from which the curve of predicted error comes."""
_AGES_S = 1e-3, 10.0


@dataclass(frozen=True)
class Key:
    """What the colours of a picture mean.

    Attributes:
        scale: the values at both ends of the palette with their unit, in words; empty where colours are those seen.
        palette: name of the palette; empty where there is none.
    """

    scale: str = ""
    palette: str = ""

    @classmethod
    def of(cls, scale: ColorScale) -> Key:
        """That of a map."""
        return cls(f"{number(scale.shown[0])} to {number(scale.shown[1])} {scale.unit}", scale.palette)

    @property
    def colours(self) -> list[str]:
        """Colours from the low end of the palette to the high one, as a style sheet has them."""
        return [f"#{bytes(one).hex()}" for one in palette(self.palette)[::17]] if self.palette else []


@lru_cache(maxsize=1)
def _codes() -> NDArray[np.uint8]:
    linear = torch.linspace(0.0, 1.0, 1 << 16)[:, None, None].expand(-1, 1, 3)
    return (encode(linear)[:, 0, 0] * 255.0 + 0.5).byte().numpy()


def codes(image: Float[Tensor, "h w 3"]) -> PagePixels:
    """``(h, w, 3)`` uint8 sRGB of linear RGB, by a table of 65536 entries; not a number is black."""
    finite = np.nan_to_num(image.numpy(), nan=0.0, posinf=0.0, neginf=0.0)
    np.clip(finite, 0.0, 1.0, out=finite)
    finite *= 65535.0
    finite += 0.5
    return np.take(_codes(), finite.astype(np.uint16))


def overlays(seen: DisplayState, config: TsarConfig, time_s: float) -> Mapping[str, Callable[[], ByteMap]]:
    """Maps that can be drawn of what stands on a display, by label; each is made when it is called.

    Args:
        seen: record and image.
        config: of the run.
        time_s: now.
    """
    record, display = seen.shown
    found: dict[str, Callable[[], ByteMap]] = {}
    scales = Scales(config.spatial_bounds, config.temporal_bounds)
    if record is not None:
        densities = record.densities
        rate = "refreshes per cycle"
        found[TILING] = partial(tiling_map, record.tiling, densities.temporal, max(config.shape), scales.temporal)
        found[SPATIAL] = partial(density_map, densities.spatial, scales.spatial, "samples per element")
        found[TEMPORAL] = partial(density_map, densities.temporal, scales.temporal, rate, RATE_MAP)
    if display.sample_map is not None:
        found[AGES] = partial(age_map, display.sample_map.newest_s, time_s, _AGES_S)
    for label in display.maps:
        found[label] = partial(_of_policy, seen, label)
    return found


def _of_policy(seen: DisplayState, label: str) -> ByteMap:
    one = seen.shown[1].maps[label]
    return ByteMap(
        stored(one.values.numpy().astype(np.float64), one.bounds), ColorScale.of(one.bounds, one.unit, RATE_MAP)
    )


def laid_over(picture: PagePixels, one: ByteMap, strength: float) -> PagePixels:
    """A map over a picture.

    Args:
        picture: ``(h, w, 3)``.
        one: the map, at any size.
        strength: share of the map's colours, in [0, 1].
    """
    colours = enlarge(one.pixels(), picture.shape[1], picture.shape[0])
    return (picture + strength * (colours.astype(np.float32) - picture) + 0.5).astype(np.uint8)


def mean_newest_s(seen: DisplayState) -> float | None:
    """Mean time of the newest samples that are shown, seconds; None where the policy cannot tell."""
    samples = seen.shown[1].sample_map
    if samples is None:
        return None
    newest = samples.newest_s.numpy()
    known = newest[np.isfinite(newest)]
    return float(known.mean()) if known.size else None


def predicted_error(seen: DisplayState) -> float | None:
    """Root of the mean square that the policy takes its errors to have; None where it does not tell."""
    maps = seen.shown[1].maps
    if EXPECTED not in maps:
        return None
    try:
        return float(np.sqrt(np.square(maps[EXPECTED].values.numpy(), dtype=np.float64).mean()))
    except Exception:  # a map may be anybody's; the overlay says why it cannot be drawn
        return None
