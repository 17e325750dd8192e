"""Decoders of pictures: each makes an array of the numbers that a file holds.

Sources: Ward, "Real Pixels" (Graphics Gems II, 1991) and the Radiance file format for ``.hdr``; P. Debevec's Portable
FloatMap for ``.pfm``; TIFF 6.0 (Adobe, 1992) for pictures of floating-point numbers.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from pathlib import Path
from typing import BinaryIO

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image

Pixels = NDArray[np.float32]
_RADIANCE = (".hdr", ".pic", ".rgbe")

PIXELS_MOST = 1 << 27
"""Most pixels of a picture, such as 16384 x 8192. A file of some kilobytes can hold more pixels than memory does; one
pixel takes about 36 bytes while its scene is loaded."""


def decoded(path: Path) -> Pixels | NDArray[np.uint8] | NDArray[np.uint16]:
    """The numbers of a picture: linear ones are float32, and whole ones are encoded with the curve of sRGB.

    Returns:
        ``(height, width, 3)`` float32, uint8 or uint16, row 0 at the top.

    Raises:
        ValueError, OSError or what the decoders raise: the file cannot be read.
    """
    ending = path.suffix.lower()
    if ending == ".exr":
        return _exr(path)
    if ending == ".pfm":
        return _pfm(path.read_bytes())
    if ending in _RADIANCE:
        return _radiance(path.read_bytes())
    if ending in (".tif", ".tiff"):
        found = _float_tiff(path.read_bytes())
        if found is not None:
            return found
    return by_pillow(path)


def _require_size(width: int, height: int) -> None:
    if not (width > 0 and height > 0):
        raise ValueError(f"expected pixels, got {width} x {height}")
    if width * height > PIXELS_MOST:
        raise ValueError(f"expected at most {PIXELS_MOST:,} pixels, got {width} x {height}")


def by_pillow(path: Path | BinaryIO) -> Pixels | NDArray[np.uint8] | NDArray[np.uint16]:
    """As :func:`decoded`, of a file that Pillow reads, or of the content of one."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # large ones are refused here
        image = Image.open(path)
    with image:
        _require_size(*image.size)
        if image.mode == "F":
            return _three(np.array(image, np.float32))
        if image.mode.startswith("I"):  # grey of 16 bits
            return _three(np.clip(np.array(image), 0, 65535).astype(np.uint16))
        return np.array(image.convert("RGB"))


def _three(grey: np.ndarray) -> np.ndarray:
    return np.repeat(grey[..., None], 3, axis=-1)


def _exr(path: Path) -> Pixels:
    with OpenEXR.File(str(path), header_only=True) as file:
        first, last = (corner.astype(np.int64) for corner in file.header()["dataWindow"])
        _require_size(*(last - first + 1).tolist())
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        if "RGB" in channels:
            return np.array(channels["RGB"].pixels, np.float32)
        if "RGBA" in channels:
            return np.array(channels["RGBA"].pixels[..., :3], np.float32)
        if len(channels) == 1 or "Y" in channels:
            grey = channels.get("Y") or next(iter(channels.values()))
            return _three(np.array(grey.pixels, np.float32))
        return np.stack([np.array(channels[name].pixels, np.float32) for name in "RGB"], axis=-1)


def _pfm(content: bytes) -> Pixels:
    """Rows come from the bottom; the sign of the scale says in which order the bytes are."""
    words: list[bytes] = []
    at = 0
    while len(words) < 4:
        end = at
        while end < len(content) and content[end : end + 1].isspace():
            end += 1
        start = end
        while end < len(content) and not content[end : end + 1].isspace():
            end += 1
        if start == end or end - start > 32:
            raise ValueError("expected the header of a Portable FloatMap")
        words.append(content[start:end])
        at = end
    channels = {b"PF": 3, b"Pf": 1}.get(words[0])
    if channels is None:
        raise ValueError("expected a Portable FloatMap")
    width, height, scale = int(words[1]), int(words[2]), float(words[3])
    _require_size(width, height)
    count = width * height * channels
    if len(content) < at + 1 + 4 * count or scale == 0.0:
        raise ValueError(f"expected {count} numbers, got fewer")
    values = np.frombuffer(content, "<f4" if scale < 0.0 else ">f4", count, at + 1).astype(np.float32)
    rows = values.reshape(height, width, channels)[::-1]
    return np.ascontiguousarray(rows if channels == 3 else np.repeat(rows, 3, axis=-1))


def _radiance(content: bytes) -> Pixels:
    """Mantissas of 8 bits with a shared exponent, plain or with runs of equal bytes; rows from the top."""
    if not content.startswith((b"#?RADIANCE", b"#?RGBE")):
        raise ValueError("expected a Radiance picture")
    head, _, rest = content.partition(b"\n\n")
    if b"FORMAT=32-bit_rle_xyze" in head:
        raise ValueError("expected a Radiance picture of red, green and blue, got one of CIE XYZ")
    size, _, body = rest.partition(b"\n")
    words = size.split()
    if len(words) != 4 or words[0] not in (b"-Y", b"+Y") or words[2] not in (b"+X", b"-X"):
        raise ValueError("expected the size of a Radiance picture")
    height, width = int(words[1]), int(words[3])
    _require_size(width, height)
    pixels, at = np.zeros((height, width, 4), np.uint8), 0
    for row in range(height):
        if not 8 <= width < 32768 or body[at : at + 4] != bytes((2, 2, width >> 8, width & 255)):
            at = _old_row(body, at, pixels[row])
            continue
        at += 4
        for channel in range(4):
            at = _row(body, at, pixels[row, :, channel])
    exponents = pixels[..., 3].astype(np.int32)
    scale = np.where(exponents > 0, np.ldexp(np.float32(1.0), exponents - 136), np.float32(0.0)).astype(np.float32)
    values = pixels[..., :3].astype(np.float32) * scale[..., None]
    values = values[::-1] if words[0] == b"+Y" else values
    return np.ascontiguousarray(values[:, ::-1] if words[2] == b"-X" else values)


def _row(body: bytes, at: int, row: NDArray[np.uint8]) -> int:
    """One channel of a row: counts above 128 repeat a byte, others are followed by as many bytes."""
    done = 0
    while done < len(row):
        count = body[at]
        run = count - 128 if count > 128 else count
        if not 0 < run <= len(row) - done:
            raise ValueError("expected runs that fill a row")
        if count > 128:
            row[done : done + run] = body[at + 1]
            at += 2
        else:
            part = body[at + 1 : at + 1 + run]
            if len(part) < run:
                raise ValueError("expected more bytes")
            row[done : done + run] = np.frombuffer(part, np.uint8)
            at += 1 + run
        done += run
    return at


def _old_row(body: bytes, at: int, row: NDArray[np.uint8]) -> int:
    """A row of whole pixels; one of mantissas 1, 1, 1 repeats the pixel before it as often as its exponent says."""
    done, shift = 0, 0
    while done < len(row):
        pixel = body[at : at + 4]
        if len(pixel) < 4:
            raise ValueError("expected more bytes")
        at += 4
        if pixel[:3] != b"\1\1\1":
            row[done] = np.frombuffer(pixel, np.uint8)
            done, shift = done + 1, 0
            continue
        run = pixel[3] << shift
        if done == 0 or shift > 16 or run > len(row) - done:
            raise ValueError("expected runs that fill a row")
        row[done : done + run] = row[done - 1]
        done, shift = done + run, shift + 8
    return at


_WIDTH, _HEIGHT, _BITS, _COMPRESSION, _STRIPS, _SAMPLES, _SIZES, _LAYOUT, _PREDICTOR, _FORMAT = (
    256, 257, 258, 259, 273, 277, 279, 284, 317, 339,
)  # fmt: skip
_KINDS = {1: "B", 3: "H", 4: "I"}


def _float_tiff(content: bytes) -> Pixels | None:
    """A TIFF file of floating-point numbers in strips, plain or deflated; None for other kinds of TIFF."""
    order = {b"II": "<", b"MM": ">"}.get(content[:2])
    if order is None or len(content) < 8:
        return None
    (start,) = struct.unpack_from(f"{order}I", content, 4)
    (count,) = struct.unpack_from(f"{order}H", content, start)
    tags: dict[int, tuple[int, ...]] = {}
    for at in range(start + 2, start + 2 + 12 * count, 12):
        tag, kind, length = struct.unpack_from(f"{order}HHI", content, at)
        if kind in _KINDS and length <= len(content):
            inside = length * struct.calcsize(_KINDS[kind]) <= 4
            place = at + 8 if inside else struct.unpack_from(f"{order}I", content, at + 8)[0]
            tags[tag] = struct.unpack_from(f"{order}{length}{_KINDS[kind]}", content, place)
    if tags.get(_FORMAT, (1,))[0] != 3:
        return None
    bits, samples = tags.get(_BITS, (32,))[0], tags.get(_SAMPLES, (1,))[0]
    packing, planar, shift = (tags.get(tag, (1,))[0] for tag in (_COMPRESSION, _LAYOUT, _PREDICTOR))
    if bits not in (16, 32, 64) or packing not in (1, 8, 32946) or (planar != 1 and samples > 1) or shift != 1:
        raise ValueError("expected a TIFF of floating-point numbers, plain or deflated, pixel by pixel")
    width, height = tags[_WIDTH][0], tags[_HEIGHT][0]
    _require_size(width, height)
    needed = width * height * samples * bits // 8
    body = b""
    for begin, size in zip(tags[_STRIPS], tags[_SIZES], strict=True):
        part = content[begin : begin + size]
        body += part if packing == 1 else zlib.decompressobj().decompress(part, needed - len(body))
    values = np.frombuffer(body, f"{order}f{bits // 8}", width * height * samples).astype(np.float32)
    pixels = values.reshape(height, width, samples)
    return np.ascontiguousarray(pixels[..., :3] if samples >= 3 else np.repeat(pixels[..., :1], 3, axis=-1))
