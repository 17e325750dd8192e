"""EXR files with several layers: the picture and further data of its pixels."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.film.files import FilmError, placed

CHANNELS = {1: ("",), 2: ("X", "Y"), 3: ("R", "G", "B")}
"""Suffixes of a layer's channels by their number; vector layers have suffixes of their own."""


def write_layers(path: Path, layers: Mapping[str, NDArray[np.floating] | NDArray[np.integer]]) -> None:
    """Writes layers ``(h, w)`` or ``(h, w, channels)``.

    The layer ``""`` is the picture with the channels R, G and B. A layer ``normal`` has the channels ``normal.X``,
    ``.Y`` and ``.Z``; other layers of three channels have ``.R``, ``.G`` and ``.B``, those of two ``.X`` and ``.Y``,
    and a layer of one channel has its name alone (``Z`` for depth, as compositing programs expect). All channels are
    32-bit floats.

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
