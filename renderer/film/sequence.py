"""Stills of a sequence: their names, and films made from them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from renderer.film.files import LosslessWriter, Mp4Writer


def still_path(folder: Path, number: int, ending: str) -> Path:
    """Path of the still with a number; ``ending`` is ``.exr``, ``.png`` or ``.ppm``."""
    return folder / f"frame{number:05d}{ending}"


def write_lossless(frames: Iterable[NDArray[np.uint8]], path: Path, fps: float) -> None:
    """Joins 8-bit frames ``(h, w, 3)`` of equal size into a lossless film.

    Raises:
        FilmError: the film cannot be written.
    """
    rest = iter(frames)
    first = next(rest)
    with LosslessWriter(path, fps, first.shape[1], first.shape[0]) as film:
        film.add(first)
        for frame in rest:
            film.add(frame)


def write_film(stills: Sequence[Path], path: Path, fps: float) -> None:
    """Joins 8-bit stills of equal size into an MP4; the last row or column of an odd size is cut off.

    Raises:
        FilmError: the film cannot be written.
    """
    with Image.open(stills[0]) as first:
        width, height = (side - side % 2 for side in first.size)
    with Mp4Writer(path, fps, width, height) as film:
        for still in stills:
            with Image.open(still) as picture:
                film.add(np.asarray(picture.convert("RGB"))[:height, :width])
