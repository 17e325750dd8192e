"""Normal maps: those that bend nothing, constant ones, and factors of their tilt."""

from __future__ import annotations

import numpy as np

from scenes.canonical import ConstantTexture, ImageTexture, NormalMapped, Texture
from scenes.formats.appearance.folding import changed, folded
from scenes.formats.losses import LossReport

_STRAIGHT = 0.5  # the value of a component that is zero


def is_flat(material: NormalMapped) -> bool:
    """Whether the normal of the shape stays as it is everywhere."""
    normals, untilted = folded(material.normals), material.scale == 0.0
    if isinstance(normals, ConstantTexture):
        across, down, out = normals.value
        return out > _STRAIGHT and (untilted or across == down == _STRAIGHT)  # others point inwards
    return untilted and not (isinstance(normals, ImageTexture) and (normals.image[..., 2] <= _STRAIGHT).any())


def map_of(normals: Texture) -> Texture:
    """The normals as a picture, of one texel if they are constant; other textures as they are."""
    plain = folded(normals)
    if not isinstance(plain, ConstantTexture):
        return plain
    return ImageTexture(np.array(plain.value, np.float32).reshape(1, 1, 3), filter="nearest", source="normals")


def scaled_normals(normals: Texture, scale: float, where: str, report: LossReport) -> Texture:
    """Normals whose first two components are multiplied, as the map itself."""
    if scale == 1.0:
        return normals

    def change(values: np.ndarray) -> np.ndarray:
        vectors = (2.0 * values - 1.0) * (scale, scale, 1.0)
        return 0.5 + 0.5 * vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)

    made = changed(folded(normals), change)
    if made is None:
        report.add(where, f"normals scaled by {scale:g}", "as they are")
    return normals if made is None else made
