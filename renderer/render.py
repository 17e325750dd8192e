"""Rendering of one picture of a scene by a single call."""

from __future__ import annotations

import dataclasses
from os import PathLike, fspath
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from renderer.frames import pictures
from renderer.sampling.plan import SamplePlan
from renderer.tables.checks import check_frame_size
from renderer.trace import Renderer
from scenes import catalog
from scenes.canonical import Scene
from scenes.catalog import Look
from tsar.checks import require


def render(
    scene: Scene | str | PathLike[str],
    size: int | tuple[int, int] = 512,
    time_s: float = 0.0,
    samples_per_pixel: int = 16,
    *,
    point_set: str = "hammersley",
    space_filter: Literal["box", "gaussian"] = "gaussian",
    seed: int = 0,
    threads: int = 0,
    look: Look | None = None,
) -> Float[NDArray[np.float32], "height width 3"]:
    """Renders a picture; the same arguments give the same bits.

    Args:
        scene: a scene, the name of a built-in one or of one that was added, a scene file, or a model.
        size: width and height, pixels, or one number for both.
        time_s: animation time at which the frame begins, seconds; samples spread over the time that the shutter is
            open.
        samples_per_pixel: at least 1; a cube for the point set ``stratified``.
        point_set: point set of the samples; a name in :data:`renderer.sampling.POINT_SETS`.
        space_filter: reconstruction filter over the picture.
        seed: seed of all random numbers.
        threads: number of threads for tracing; 0 for one per core.
        look: changes of the scene's view and lighting, and its integrator.

    Returns:
        Linear RGB, not clipped, rows from the top; :func:`renderer.film.files.write_image` writes it to a file.

    Raises:
        ValueError: an argument is out of range, or there is no such scene.
    """
    width_px, height_px = (size, size) if isinstance(size, int) else size
    require(width_px >= 1 and height_px >= 1, "size", "at least one pixel", size)
    check_frame_size(width_px, height_px, 1)
    plan = SamplePlan(samples_per_pixel, point_set, seed, space_filter)
    look = dataclasses.replace(look or Look(), pose_s=time_s)
    found, _ = catalog.load_seen(scene if isinstance(scene, Scene) else fspath(scene), look)
    renderer = Renderer(found, threads=threads or None, seed=seed)
    return pictures(renderer, plan, width_px, height_px)(0, time_s).numpy()
