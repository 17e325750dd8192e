"""Stills of a sequence, written one by one so that an interrupted rendering goes on where it stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor

from renderer.film import LosslessWriter, Mp4Writer, write_image


def still_path(folder: Path, number: int, ending: str) -> Path:
    """Where the still of a number lies; ``ending`` is ``.exr``, ``.png`` or ``.ppm``."""
    return folder / f"frame{number:05d}{ending}"


def render_stills(
    picture: Callable[[int, float], Tensor],
    times_s: Mapping[int, float],
    folder: Path,
    ending: str,
    done: Callable[[int], None] = lambda count: None,
) -> tuple[int, int]:
    """Renders the stills that are not on disk yet.

    Args:
        picture: linear radiance ``(h, w, 3)`` of the still of a number, at a time.
        times_s: animation time of each still by its number, seconds.
        folder, ending: where stills go, and their format.
        done: called with the number of stills that are on disk.

    Returns:
        How many were rendered now, and how many of their values were not finite.

    Raises:
        FilmError: a still cannot be written.
    """
    rendered, nonfinite = 0, 0
    for count, (number, time_s) in enumerate(times_s.items()):
        path = still_path(folder, number, ending)
        if not path.exists():
            nonfinite += write_image(path, picture(number, time_s))
            rendered += 1
        done(count + 1)
    return rendered, nonfinite


def write_lossless(frames: Iterable[NDArray[np.uint8]], path: Path, fps: float) -> None:
    """Joins 8-bit frames ``(h, w, 3)`` of equal size into a film that keeps every value.

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
    """Joins 8-bit stills of equal size into an MP4; a row or column beyond an even size is cut off.

    Raises:
        FilmError: the film cannot be written.
    """
    with Image.open(stills[0]) as first:
        width, height = (side - side % 2 for side in first.size)
    with Mp4Writer(path, fps, width, height) as film:
        for still in stills:
            with Image.open(still) as picture:
                film.add(np.asarray(picture.convert("RGB"))[:height, :width])
