"""Vertex colours as an image.

The renderer supports colours in images only. Each triangle gets its own 2 x 2 texels, in which bilinear lookup between
texel centres is linear interpolation between the colours of its corners.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from scenes.canonical import ConstantTexture, ImageTexture, Texture


def coloured(
    colors: Float[NDArray[np.floating], "f 3 3"], source: str
) -> tuple[Texture, Float[NDArray[np.float32], "f 3 2"] | None]:
    """A texture for triangles with these linear colours at their corners, and the texture coordinates of the corners;
    see :func:`coloured_and_covered`."""
    color, _, uvs = coloured_and_covered(colors, source)
    return color, uvs


def coloured_and_covered(
    colors: Float[NDArray[np.floating], "f 3 channels"], source: str
) -> tuple[Texture, Texture, Float[NDArray[np.float32], "f 3 2"] | None]:
    """Textures of colour and opacity for triangles with these values at their corners, and the texture coordinates of
    the corners.

    The fourth texel of a triangle, opposite to its longest edge, extrapolates the other three linearly. If that is
    negative, it is clamped to 0, and the middle of one edge is brighter by up to a quarter of the clamped amount.

    Args:
        colors: linear colours, and opacities as a fourth channel; these are 1 without it.
        source: for the textures.

    Returns:
        One colour, one opacity and no coordinates if all corners are equal.
    """
    colors = np.clip(colors, 0.0, None).astype(np.float32)
    if (colors == colors[0, 0]).all():
        red, green, blue, alpha = (*colors[0, 0].tolist(), 1.0)[:4]
        return ConstantTexture((red, green, blue)), ConstantTexture((alpha, alpha, alpha)), None
    count, _, channels = colors.shape
    side = math.ceil(math.sqrt(count))
    image = np.zeros((2 * side, 2 * side, channels), np.float32)
    # the fourth texel extrapolates from the corner for which it is least negative
    beyond = np.stack([colors.sum(axis=1) - 2.0 * colors[:, corner] for corner in range(3)], axis=1)
    turn = np.argmax(np.minimum(beyond, 0.0).sum(axis=2), axis=1)
    place = (np.arange(3) - turn[:, None]) % 3
    ordered = np.take_along_axis(colors, ((np.arange(3) + turn[:, None]) % 3)[..., None], axis=1)
    row, column = np.arange(count) // side * 2, np.arange(count) % side * 2
    image[row, column], image[row, column + 1], image[row + 1, column] = ordered[:, 0], ordered[:, 1], ordered[:, 2]
    image[row + 1, column + 1] = np.maximum(ordered[:, 1] + ordered[:, 2] - ordered[:, 0], 0.0)
    across = (column[:, None] + 0.5 + (place == 1)) / (2.0 * side)
    down = (row[:, None] + 0.5 + (place == 2)) / (2.0 * side)
    uvs = np.stack([across, 1.0 - down], axis=-1).astype(np.float32)
    color = ImageTexture(np.ascontiguousarray(image[..., :3]), wrap="clamp", filter="bilinear", source=source)
    opacity: Texture = ConstantTexture((1.0, 1.0, 1.0))
    if channels == 4:
        opacity = dataclasses.replace(color, image=image[..., 3:].repeat(3, 2))
    return color, opacity, uvs
