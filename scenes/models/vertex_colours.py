"""Colours of vertices as a picture.

The renderer looks colours up in pictures. Each triangle gets 2 x 2 texels of its own, in which bilinear lookup between
texel centres is linear interpolation between the colours of its corners.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from scenes.canonical import ConstantTexture, ImageTexture, Texture


def coloured(
    colors: Float[NDArray[np.floating], "f 3 3"], source: str
) -> tuple[Texture, Float[NDArray[np.float32], "f 3 2"] | None]:
    """A texture for triangles whose corners have these linear colours, and the corners' texture coordinates.

    The fourth texel of a triangle, beyond its longest reach, continues the plane through the other three; where that is
    negative it is 0, and the middle of one edge is brighter by up to a quarter of what was cut off.

    Returns:
        One colour and no coordinates where all are alike.
    """
    colors = np.clip(colors, 0.0, None).astype(np.float32)
    if (colors == colors[0, 0]).all():
        red, green, blue = colors[0, 0].tolist()
        return ConstantTexture((red, green, blue)), None
    count = len(colors)
    side = math.ceil(math.sqrt(count))
    image = np.zeros((2 * side, 2 * side, 3), np.float32)
    # the fourth texel continues from the corner from which it is least negative
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
    return ImageTexture(image, wrap="clamp", filter="bilinear", source=source), uvs
