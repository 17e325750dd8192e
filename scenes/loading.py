"""Image files as arrays, and the assets of the project.

A failure is a SceneError that names the file and the reason.
"""

from __future__ import annotations

import warnings
from functools import lru_cache
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import power, product
from scenes.canonical import SceneError
from scenes.chromaticities import to_rec709
from scenes.pictures import Pixels, alpha_of, chromaticities_of, decoded

ASSETS = Path(__file__).parent / "assets"


RADIANCE_MOST = 65504.0
"""The greatest half-precision number, which replaces infinite values of an image."""


def one_line(error: BaseException) -> str:
    """The message of an error without line breaks; its type if it has none."""
    return " ".join(str(error).split()) or type(error).__name__


def asset(name: str) -> Path:
    """Path of a file delivered with the project.

    Raises:
        SceneError: no asset has this name.
    """
    path = ASSETS / name
    if not path.is_file():
        raise SceneError(f"asset {name!r}: expected a file at {path}, found none")
    return path


FileState = tuple[int, int, int, int]


def state_of(path: Path) -> FileState | None:
    """Times, size and inode of a file, which change when it is modified or replaced; None if there is no file.

    Contents of a file are cached as long as its state is the same.
    """
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_ctime_ns, found.st_size, found.st_ino


def read_image(path: Path) -> Pixels:
    """Reads an image as linear Rec. 709 RGB.

    Integers of 8 or 16 bits are decoded from sRGB; OpenEXR, Radiance, PFM and floating-point TIFF files are linear,
    and become Rec. 709 if OpenEXR or Radiance files name other primaries.
    Infinite values, such as those of a sun beyond half precision, become :data:`RADIANCE_MOST`, with a warning.

    Args:
        path: PNG, JPEG or another format Pillow reads, ``.exr``, ``.hdr``, ``.pfm`` or ``.tif``.

    Returns:
        ``(height, width, 3)`` float32, row 0 at the top; shared between callers, so read-only.

    Raises:
        SceneError: the file is missing, cannot be read, or holds more than :data:`scenes.pictures.PIXELS_MOST` pixels.
    """
    path = Path(path)
    if not path.is_file():
        raise SceneError(f"texture {path}: expected an image file, found none")
    return _image(path, state_of(path))[0]


def read_values(path: Path) -> Pixels:
    """The values of an image ``(h, w, 3)`` as they are in the file, integers as fractions of the greatest one; not
    read-only.

    Raises:
        SceneError: the file cannot be read.
    """
    try:
        found = decoded(path)
    except Exception as error:  # decoders raise arbitrary exceptions on broken files
        raise SceneError(f"texture {path}: cannot be read: {one_line(error)}") from error
    values = fractions(found)
    if not np.isfinite(values).all():
        raise SceneError(f"texture {path}: expected finite values")
    return values


def read_alpha(path: Path) -> Pixels:
    """The opacity ``(h, w)`` of an image; 1 where it has none.

    Raises:
        SceneError: the file cannot be read.
    """
    try:
        return alpha_of(path)
    except Exception as error:  # decoders raise arbitrary exceptions on broken files
        raise SceneError(f"texture {path}: cannot be read: {one_line(error)}") from error


def is_linear(path: Path) -> bool:
    """Whether an image file holds linear and not encoded values; raises as :func:`read_image`."""
    read_image(path)
    return _image(Path(path), state_of(Path(path)))[1]


@lru_cache(maxsize=32)
def _image(path: Path, state: FileState | None) -> tuple[Pixels, bool]:
    try:
        found = decoded(path)
        linear = found.dtype == np.float32
        pixels = (
            rec709(_clamped(cast(Pixels, found), path), path) if linear else decode_srgb(cast(NDArray[np.uint8], found))
        )
    except Exception as error:  # decoders raise arbitrary exceptions on broken files
        raise SceneError(f"texture {path}: cannot be read: {one_line(error)}") from error
    bad = int((~np.isfinite(pixels)).any(axis=-1).sum())
    if bad:
        raise SceneError(f"texture {path}: expected finite values, got {bad} pixels without")
    pixels.flags.writeable = False
    return pixels, linear


def rec709(pixels: Pixels, path: Path) -> Pixels:
    """Linear values of a file as Rec. 709, if it names other primaries; negative channels become 0.

    Raises:
        ValueError: the file cannot be read.
    """
    given = chromaticities_of(path)
    matrix = None if given is None else to_rec709(given)
    return pixels if matrix is None else np.maximum(product(pixels, matrix.T), 0.0).astype(np.float32)


def _clamped(pixels: Pixels, path: Path) -> Pixels:
    """An image with infinite values replaced."""
    infinite = np.isposinf(pixels)
    if not infinite.any():
        return pixels
    count = int(infinite.any(axis=-1).sum())
    warnings.warn(f"texture {path}: {count} pixels of infinite radiance became {RADIANCE_MOST:g}", stacklevel=4)
    return np.where(infinite, np.float32(RADIANCE_MOST), pixels)


def fractions(image: Pixels | NDArray[np.uint8] | NDArray[np.uint16]) -> Pixels:
    """The values of an image, integers as fractions of the greatest one of their type."""
    if image.dtype == np.float32:
        return cast(Pixels, image)
    return image.astype(np.float32) / np.float32(np.iinfo(cast(NDArray[np.uint8], image).dtype).max)


def decode_srgb(encoded: NDArray[np.uint8] | NDArray[np.uint16]) -> NDArray[np.float32]:
    """Linear values of 8-bit or 16-bit sRGB values."""
    most = np.iinfo(encoded.dtype).max
    steps = np.arange(most + 1, dtype=np.float32) / np.float32(most)
    bright = power((steps + np.float32(0.055)) / np.float32(1.055), np.float32(2.4)).astype(np.float32)
    return np.where(steps > np.float32(0.04045), bright, steps / np.float32(12.92))[encoded]


def encoded_srgb(image: Pixels) -> Pixels:
    """sRGB values of linear ones, not rounded: the inverse of decoding, for an image that was linear already."""
    low = image <= 0.0031308
    return np.where(low, 12.92 * image, 1.055 * power(np.maximum(image, 0.0), 1.0 / 2.4) - 0.055).astype(np.float32)


def clamp_radiance(image: Pixels, limit: float) -> Pixels:
    """Scales down texels whose greatest channel exceeds ``limit``, preserving their colour.

    The sun's disk in an environment map is tens of thousands of times brighter than the sky. In a mirror, where one
    sample in thousands hits it, it would cause noise that no practical number of samples removes. A directional light
    replaces the light of the disk.
    """
    peak = image.max(axis=-1, keepdims=True)
    return (image * np.minimum(1.0, limit / np.maximum(peak, 1e-12))).astype(np.float32)
