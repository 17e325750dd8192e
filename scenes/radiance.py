"""Headers of Radiance pictures (``.hdr``, ``.pic``): what their pixels mean.

Source: G. Ward, "Radiance file formats" (filefmts.pdf), section on pictures; ``color.h`` and ``resolu.h`` of Radiance.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_LINES_MOST = 1 << 20  # bytes
_RESOLUTION = re.compile(rb"([+-])([XY]) +(\d+) +([+-])([XY]) +(\d+)\s*$")
_EXPOSURES = 1e-30, 1e30  # with others, values of most pictures would be infinite or 0
_ORDER = {b"Y": b"-", b"X": b"+"}
_FORMATS = {b"32-bit_rle_rgbe": False, b"32-bit_rle_xyze": True}
XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0)
"""Chromaticities of the axes of CIE XYZ, and their white, that of equal energy."""


@dataclass(frozen=True)
class RadianceHeader:
    """The header of a picture.

    Attributes:
        divisor: product of the exposures and colour corrections, by which values are divided.
        chromaticities: ``x`` and ``y`` of red, green, blue and white; None if the file does not tell them.
        columns: whether the file has columns in place of rows.
        ordered: whether rows go down and their pixels to the right; for columns, whether these go to the right and
            their pixels down.
        is_plain: whether the library reads the file as it is: rows go down, their pixels to the right, values are red,
            green and blue, and the header names its format.
        plain: the header with the same number of pixels whose rows go down and whose pixels go to the right.
        start: number of bytes before the pixels.
    """

    divisor: tuple[float, float, float]
    chromaticities: tuple[float, ...] | None
    columns: bool
    ordered: tuple[bool, bool]
    is_plain: bool
    plain: bytes
    start: int

    def upright(self, pixels: NDArray[np.float32]) -> NDArray[np.float32]:
        """The picture ``(h, w, 3)`` of the values in the file, its first row at the top."""
        found = pixels[:: 1 if self.ordered[0] else -1, :: 1 if self.ordered[1] else -1]
        found = np.swapaxes(found, 0, 1) if self.columns else found
        return np.ascontiguousarray(found / np.array(self.divisor, np.float32))


def header_of(path: Path) -> RadianceHeader | None:
    """The header of a picture; None if it is not one of Radiance with a known format.

    Raises:
        ValueError: numbers of the header cannot be read.
    """
    with path.open("rb") as file:
        content = file.read(_LINES_MOST)
    head, blank, rest = content.partition(b"\n\n")
    size = _RESOLUTION.match(rest.partition(b"\n")[0])
    pairs = [line.partition(b"=")[::2] for line in head.split(b"\n")]
    kinds = [_FORMATS.get(value.strip()) for name, value in pairs if name.strip() == b"FORMAT"]
    if not content.startswith(b"#?") or not blank or size is None or None in kinds[-1:]:
        return None
    is_xyz = bool(kinds and kinds[-1])  # red, green and blue if no format is named
    divisor, chromaticities = np.ones(3), XYZ if is_xyz else None
    for name, value in pairs:
        if name in (b"EXPOSURE", b"COLORCORR"):
            divisor *= _numbers(name, value, 1 if name == b"EXPOSURE" else 3)
        elif name == b"PRIMARIES" and not is_xyz:
            chromaticities = tuple(_numbers(name, value, 8).tolist())
    if not ((divisor >= _EXPOSURES[0]) & (divisor <= _EXPOSURES[1])).all():
        least, most = _EXPOSURES
        raise ValueError(
            f"expected exposures from {least:g} to {most:g}, got {', '.join(f'{one:g}' for one in divisor)}"
        )
    first, axis, count, second, other, length = size.groups()
    if axis == other:
        raise ValueError(f"expected X and Y, got {size.group().decode()}")
    ordered = first == _ORDER[axis], second == _ORDER[other]
    plain = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + count + b" +X " + length + b"\n"
    red, green, blue = divisor.tolist()
    start = len(head) + len(blank) + len(rest.partition(b"\n")[0]) + 1
    is_plain = axis == b"Y" and ordered == (True, True) and bool(kinds) and not is_xyz
    return RadianceHeader((red, green, blue), chromaticities, axis == b"X", ordered, is_plain, plain, start)


def _numbers(name: bytes, value: bytes, count: int) -> NDArray[np.float64]:
    try:
        found = np.array([float(word) for word in value.split()])
    except ValueError:
        found = np.zeros(0)
    if len(found) != count:
        raise ValueError(
            f"expected {count} numbers behind {name.decode()}, got {value.decode(errors='replace')[:40]!r}"
        )
    return found
