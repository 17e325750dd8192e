"""EXR files of several layers: the picture and what is known of its pixels."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.film.files import FilmError, placed

CHANNELS = {1: ("",), 2: ("X", "Y"), 3: ("R", "G", "B")}
"""Endings of the channels of a layer by its depth; layers of vectors name their own."""


def write_layers(
    path: Path, layers: Mapping[str, NDArray[np.floating] | NDArray[np.integer]], half: bool = False
) -> None:
    """Writes layers ``(h, w)`` or ``(h, w, channels)``.

    A layer named ``""`` is the picture, channels R, G and B; a layer ``normal`` has ``normal.X``, ``.Y`` and ``.Z``,
    other ones of three channels ``.R``, ``.G`` and ``.B``, of two ``.X`` and ``.Y``, and one of a single channel its
    name alone (``Z`` for depth, as programs that composite pictures expect). All are floats of 32 bits.

    Raises:
        FilmError: the file cannot be written.
    """
    import OpenEXR

    channels: dict[str, NDArray] = {}
    for name, values in layers.items():
        parts = values[..., None] if values.ndim == 2 else values
        endings = ("X", "Y", "Z") if name == "normal" else CHANNELS[parts.shape[-1]]
        for part, ending in enumerate(endings):
            title = "Z" if name == "depth" else f"{name}.{ending}".strip(".")
            channels[title] = np.ascontiguousarray(parts[..., part], np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with placed(path) as temporary:
        try:
            OpenEXR.File(header, channels).write(str(temporary))
        except (RuntimeError, ValueError) as error:
            raise FilmError(f"{path}: cannot be written ({error})") from None
