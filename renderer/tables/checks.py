"""Checks that reject values of a scene or a picture that kernels cannot use; errors have one line."""

from __future__ import annotations

import numpy as np

from scenes.canonical import SceneError
from tsar.memory import free_memory_bytes

_BYTES_PER_PIXEL = 12
_SAMPLES_PER_PIXEL_AXIS_MAX = 1024
_SAMPLES_PER_AXIS_MAX = 1 << 22  # float32 distinguishes that many positions


def check_finite(values: object, what: str) -> None:
    """Raises SceneError unless all values are finite in float32."""
    with np.errstate(over="ignore"):
        good = np.isfinite(np.asarray(values, np.float32)).all()
    if not good:
        raise SceneError(f"{what}: expected finite values, got {_described(values)}")


def check_light(values: object, what: str) -> None:
    """Raises SceneError unless all values of a radiance or reflectance are finite and not negative."""
    check_finite(values, what)
    if (np.asarray(values) < 0.0).any():
        raise SceneError(f"{what}: expected no negative values, got {_described(values)}")


def check_affine(matrix: object, what: str) -> None:
    """Raises SceneError unless a ``(4, 4)`` transform can be inverted and keeps parallel lines parallel."""
    rows = np.asarray(matrix, np.float64)
    if rows.shape != (4, 4) or not np.isfinite(rows).all():
        raise SceneError(f"{what}: expected a finite (4, 4) matrix")
    if not np.allclose(rows[3], (0.0, 0.0, 0.0, 1.0), rtol=0.0, atol=1e-9):
        raise SceneError(f"{what}: expected (0, 0, 0, 1) in the last row, got {tuple(rows[3].tolist())}")
    stretch = np.linalg.svd(rows[:3, :3], compute_uv=False)
    if not stretch[2] > 1e-14 * stretch[0]:
        raise SceneError(f"{what}: expected a matrix that can be inverted")


def _described(values: object) -> str:
    array = np.asarray(values)
    if array.size > 4:
        return f"{array.size} values from {array.min()} to {array.max()}"
    return str(array.tolist())


def check_frame_size(width_px: int, height_px: int, samples_per_axis: int) -> None:
    """Raises ValueError if a picture has too many samples along an axis or does not fit into memory."""
    if samples_per_axis > _SAMPLES_PER_PIXEL_AXIS_MAX:
        raise ValueError(f"samples_per_axis: expected at most {_SAMPLES_PER_PIXEL_AXIS_MAX}, got {samples_per_axis}")
    if max(width_px, height_px) * samples_per_axis > _SAMPLES_PER_AXIS_MAX:
        raise ValueError(
            f"render_frame: expected at most {_SAMPLES_PER_AXIS_MAX:,} samples along an axis, got "
            f"{max(width_px, height_px)} pixels of {samples_per_axis}"
        )
    need, have = width_px * height_px * _BYTES_PER_PIXEL, free_memory_bytes()
    if need > have:
        raise ValueError(
            f"render_frame: {width_px} x {height_px} pixels need about {need / 2**30:.1f} GiB of memory, "
            f"{have / 2**30:.1f} GiB are free"
        )
