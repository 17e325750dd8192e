"""Constants that the compiled stages, their C++ and the reference share; no header repeats one of them."""

from __future__ import annotations

import numpy as np

from tsar.error import OCTAVES_OF_FULL_ERROR
from tsar.filtering import change, motion, records, samples, tiles
from tsar.reconstruction import AGE_MOST, AGE_STEPS, SHIFT_CYCLES
from tsar.response.local import AT_WALL
from tsar.types import LUMINANCE

SAMPLES_MAX = 1024
"""Maximum number of samples of a framelet in the estimate of errors."""
OCTAVES_MAX = 5
"""Number of octaves of such a framelet."""
COLUMNS = 8
"""Number of quantities of an element that the passes of the response share."""
PLANES = 5
"""Number of planes of a band of the image: the threshold of ages, and sums of weight, red, green and blue."""

GIVEN: dict[str, float] = {
    "SAMPLES_MAX": SAMPLES_MAX,
    "OCTAVES_MAX": OCTAVES_MAX,
    "COLUMNS": COLUMNS,
    "PLANES": PLANES,
    "OCTAVES_OF_FULL_ERROR": OCTAVES_OF_FULL_ERROR,
    "AGE_MOST": AGE_MOST,
    "AGE_STEPS": AGE_STEPS,
    "SHIFT_CYCLES": SHIFT_CYCLES,
    "AT_WALL": np.float64(AT_WALL),
    **dict(zip(("LUMINANCE_RED", "LUMINANCE_GREEN", "LUMINANCE_BLUE"), LUMINANCE, strict=True)),
}
"""The constants of this module as the C++ gets them."""

PIXEL_WORDS = 6
"""Size of the sums over a pixel's samples in words of eight bytes."""
FRAME = 8
"""Empty columns on either side of each row of depths, so that every pixel has neighbours."""
POSE_NUMBERS = 12
"""Count of numbers that take an instance to the camera: three rows of a matrix, and an offset."""
LEVEL_PLANES = 5
"""Number of planes of a level of the picture's pyramid: red, green, blue, variance, roughness."""
NOISE_ROWS = 22
"""Number of rows that a thread keeps to tell noise from detail: nine of colours, twelve of sums, and one."""

FILTERING: dict[str, float] = {
    "PIXEL_WORDS": PIXEL_WORDS,
    "FRAME": FRAME,
    "POSE_NUMBERS": POSE_NUMBERS,
    "LEVEL_PLANES": LEVEL_PLANES,
    "NOISE_ROWS": NOISE_ROWS,
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
    "BETWEEN": change.BETWEEN,
    "GAP_MOST_S": change.GAP_MOST_S,
    "SHARE_NEAR": change.SHARE_NEAR,
    "SHARE_AROUND": change.SHARE_AROUND,
    "COUNT_LEAST": samples.COUNT_LEAST,
    "SPEED_LEAST": tiles.SPEED_LEAST,
    "EDGE_GROWTH": np.float64(tiles.EDGE_GROWTH),
    "PRICE_ABOVE": np.float64(tiles.PRICE_ABOVE),
    "BISECTIONS": tiles.BISECTIONS,
    "PRICE_LEAST": tiles.PRICE_LEAST,
}
"""Constants of the filter's stages as their C++ gets them."""
