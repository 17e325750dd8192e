"""Numbers that the compiled stages, their C++ and the reference share; no header repeats one of them."""

from __future__ import annotations

from tsar.error import OCTAVES_OF_FULL_ERROR
from tsar.filtering import change, motion, records, samples, tiles
from tsar.reconstruction import AGE_MOST, AGE_STEPS, SHIFT_CYCLES
from tsar.types import LUMINANCE

SAMPLES_MAX = 1024
"""Samples of a framelet that the estimate of errors has room for."""
OCTAVES_MAX = 5
"""Octaves of such a framelet."""
COLUMNS = 8
"""Quantities of an element that the passes of the response hand on."""
PLANES = 5
"""Of a band of the image: the threshold of ages, and sums of weight, red, green and blue."""

GIVEN: dict[str, float] = {
    "SAMPLES_MAX": SAMPLES_MAX,
    "OCTAVES_MAX": OCTAVES_MAX,
    "COLUMNS": COLUMNS,
    "PLANES": PLANES,
    "OCTAVES_OF_FULL_ERROR": OCTAVES_OF_FULL_ERROR,
    "AGE_MOST": AGE_MOST,
    "AGE_STEPS": AGE_STEPS,
    "SHIFT_CYCLES": SHIFT_CYCLES,
    **dict(zip(("LUMINANCE_RED", "LUMINANCE_GREEN", "LUMINANCE_BLUE"), LUMINANCE, strict=True)),
}
"""As in :mod:`renderer.compute.sizes`."""

PIXEL_WORDS = 6
"""Words of eight bytes for what the samples of a pixel say together."""
FRAME = 8
"""Columns of nothing beside each row of depths, so that every pixel has neighbours."""

FILTERING: dict[str, float] = {
    "PIXEL_WORDS": PIXEL_WORDS,
    "FRAME": FRAME,
    "NOTHING_KNOWN": records.NOTHING_KNOWN,
    "VARIANCE_MAX": records.VARIANCE_MAX,
    "UNSEEN": records.UNSEEN,
    "NEARER": motion.NEARER,
    "NEARER_COUNT": motion.NEARER_COUNT,
    "DEPTH_SHIFT": motion.DEPTH_SHIFT,
    "DEPTHS": motion.DEPTHS,
    "SCORES": motion.SCORES,
    "SCORE_SCALE": motion.SCORE_SCALE,
    "BESIDE": motion.BESIDE,
    "TILE_SIDE": records.TILE_SIDE,
    "ELEMENT_PX": records.ELEMENT_PX,
    "ROUGHNESS_MIN": samples.ROUGHNESS_MIN,
    "MOVES_PX": samples.MOVES_PX,
    "SHARE_MOVING": samples.SHARE_MOVING,
    "TOLERANCE": change.TOLERANCE,
    "SURE": change.SURE,
    "DROPPED": change.DROPPED,
    "RATE_MIN": change.RATE_MIN,
    "SPAN_MIN_S": change.SPAN_MIN_S,
    "BISECTIONS": tiles.BISECTIONS,
    "PRICE_LEAST": tiles.PRICE_LEAST,
}
"""The same for the filter's stages."""
