"""Colours of images with other primaries than those of Rec. 709."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from scenes.arithmetic import determinant, inverse, product

Matrix3 = Float[NDArray[np.float64], "3 3"]

REC_709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""``x`` and ``y`` of red, green, blue and white of Rec. 709."""

_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""Matrix from CIE XYZ to the responses of cones in which white points are scaled (ICC.1, annex E)."""

_ALIKE = 1e-3  # greatest difference of matrices of the same colours
_FLAT = 1e-6  # area of primaries that span no colours


def to_rec709(chromaticities: Sequence[float]) -> Matrix3 | None:
    """The matrix to linear Rec. 709 from colours with other primaries; white stays white.

    Args:
        chromaticities: ``x`` and ``y`` of red, green, blue and white.

    Returns:
        None if the primaries are those of Rec. 709, or span no colours, as the zeros that some programs write.

    Source: SMPTE RP 177, "Derivation of basic television color equations"; ICC.1, annex E.
    """
    corners = _corners(chromaticities)
    if not (np.isfinite(corners).all() and corners[1, 3] > 0.0 and abs(determinant(corners)) > _FLAT):
        return None
    from_white, from_ours = _adapted(corners), _adapted(_corners(REC_709))
    found = product(inverse(from_ours), from_white)
    return None if np.abs(found - np.eye(3)).max() < _ALIKE else found


def _corners(chromaticities: Sequence[float]) -> Float[NDArray[np.float64], "3 4"]:
    """Chromaticities ``x``, ``y``, ``z`` of red, green, blue and white as columns."""
    x, y = np.asarray(chromaticities, np.float64).reshape(4, 2).T
    return np.stack([x, y, 1.0 - x - y])


def _adapted(corners: Float[NDArray[np.float64], "3 4"]) -> Matrix3:
    """The matrix from colours to responses of cones, of which those of white are 1."""
    white = corners[:, 3] / corners[1, 3]
    to_xyz = corners[:, :3] * product(inverse(corners[:, :3]), white)
    return product(_BRADFORD, to_xyz) / product(_BRADFORD, white)[:, None]
