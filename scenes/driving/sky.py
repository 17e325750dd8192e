"""The sky of the driving scenes: an image of a sky over a strip of hills, and the sun in it.

Source: Stephens 2011, sec. 7.1.1.1, which describes such a world; images and numbers are our own.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d

from scenes.arithmetic import cos, exp, power, product, sin
from scenes.canonical import DirectionalLight, EnvironmentLight, Rgb
from scenes.driving.meshing import Array
from scenes.loading import FileState, asset, clamp_radiance, read_image, state_of

SKY_LIMIT = 6.0
"""Greatest radiance of the sky; the sun's disk is a directional light."""

SUN_IRRADIANCE: Rgb = (3.1, 2.95, 2.65)
_SKY_PX = (1536, 3072)
_HORIZON_DEG = 10.0  # height of the strip of hills above the horizon
_SEAM_PX = 384  # columns by which the hills and their mirror image are shifted: the joints then lie behind houses
_Y_UP_TO_Z_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
_SUN_UV = (0.595, 0.232)  # position of the sun in the sky image


def sun_towards() -> Array:
    """Unit vector towards the sun."""
    turn, polar = 2.0 * np.pi * _SUN_UV[0], np.pi * _SUN_UV[1]
    local = np.array(
        [
            sin(turn) * sin(polar),
            cos(polar),
            -cos(turn) * sin(polar),
        ]
    )
    return product(_Y_UP_TO_Z_UP[:3, :3], local)


def _gaussian(sigma: float, radius: int) -> Array:
    """Weights of a Gaussian filter, whose sum is one."""
    weights = exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    return weights / weights.sum()


def blurred(image: Array, sigma: float) -> Array:
    """An image ``(h, w)`` filtered by a periodic Gaussian, truncated at four standard deviations."""
    weights = _gaussian(sigma, int(4.0 * sigma + 0.5))
    return correlate1d(correlate1d(image, weights, 0, mode="wrap"), weights, 1, mode="wrap")


def _resized(image: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
    """Bilinear resizing, after a Gaussian filter along axes that are reduced, as ``kornia.geometry.transform.resize``
    with antialias."""
    planes = image.astype(np.float64)
    factors = image.shape[0] / height, image.shape[1] / width
    for axis, factor in enumerate(factors):
        if max(factors) > 1.0:
            sigma = max((factor - 1.0) / 2.0, 1e-3)
            planes = correlate1d(planes, _gaussian(sigma, int(max(4.0 * sigma, 3.0)) // 2), axis, mode="mirror")
    for axis, (factor, count) in enumerate(zip(factors, (height, width), strict=True)):
        last = image.shape[axis] - 1
        # positions in float32, as in kornia
        at = np.clip((np.float64(np.float32(factor)) * (np.arange(count) + 0.5) - 0.5).astype(np.float32), 0.0, last)
        first = at.astype(np.int64)
        share = np.expand_dims(at - first, (1, 2) if axis == 0 else (0, 2))
        near, far = (np.take(planes, index, axis) for index in (first, np.minimum(first + 1, last)))
        planes = near * (1.0 - share) + far * share
    return planes.astype(np.float32)


def sky() -> EnvironmentLight:
    """Sky with a strip of hills, whose upper edge fades into the haze."""
    return _sky(*(state_of(asset(name)) for name in ("sky.exr", "landscape_band.jpg")))


@lru_cache(maxsize=1)
def _sky(*states: FileState | None) -> EnvironmentLight:
    height, width = _SKY_PX
    horizon, tall = height // 2, round(_HORIZON_DEG / 180.0 * height)
    picture = read_image(asset("sky.exr"))
    scale = height // len(picture)
    above = clamp_radiance(picture[: horizon // scale + 1], SKY_LIMIT)  # the last row needs one more
    image = np.empty((height, width, 3), np.float32)
    image[:horizon] = _resized(above, scale * len(above), width)[:horizon]
    hills = np.ascontiguousarray(_resized(read_image(asset("landscape_band.jpg"))[:190], tall, width // 2))
    strip = np.roll(np.concatenate([hills, hills[:, ::-1]], axis=1), _SEAM_PX, axis=1)
    fade = power(np.linspace(0.0, 1.0, tall), 0.45)[:, None, None]
    haze = image[horizon - tall : horizon].mean(axis=(0, 1))
    solid = np.clip(fade * 1.6, 0.0, 1.0)
    distant = 0.75 * haze * (1.0 - fade) + strip * 1.25 * fade
    image[horizon - tall : horizon] = image[horizon - tall : horizon] * (1.0 - solid) + distant * solid
    image[horizon:] = strip[-1].mean(axis=0) * 1.25
    image.flags.writeable = False
    return EnvironmentLight(image, _Y_UP_TO_Z_UP, source="sky.exr, landscape_band.jpg")


def sun() -> DirectionalLight:
    """Sunlight from the direction of the sun in the sky image."""
    x, y, z = (-sun_towards()).tolist()
    return DirectionalLight((x, y, z), SUN_IRRADIANCE)
