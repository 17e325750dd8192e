"""A picture in tiles over processes or machines, with the same bits wherever and in whatever order tiles are
rendered."""

from __future__ import annotations

import dataclasses
import io
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.command.awaited import OTHER_SOURCE
from analysis.command.progress import Task
from analysis.storage.reference import content_hash
from analysis.storage.source import brought, code_hash
from analysis.storage.store import Store
from analysis.tracer.options import TileOptions

if TYPE_CHECKING:
    from distributed import Client
    from torch import Tensor

    from renderer.frames import Crop
    from renderer.trace import Renderer
    from scenes.catalog import Look

_RETRIES = 5


@dataclass(frozen=True)
class PictureTask:
    """Complete description of a picture, small enough to send with every chunk."""

    scene: str
    look: Look
    size_px: tuple[int, int]
    crop: Crop | None
    samples: int
    point_set: str
    space_filter: str
    time_s: float
    seed: int
    threads: int
    source: str
    """:func:`source_of` the scene and its look."""

    @property
    def name(self) -> str:
        """Name for its files: that of the scene, without folder and ending if the scene is a file."""
        return Path(self.scene).stem

    @property
    def content(self) -> dict[str, Any]:
        """Everything that decides the bits: all fields except the threads."""
        return {name: value for name, value in dataclasses.asdict(self).items() if name != "threads"}


@lru_cache(maxsize=4)
def source_of(scene: str, look: Look, point_set: str) -> str:
    """Hash of the content of a scene, with changes of its view and lighting, and of the code that renders it.

    It is taken once in a process, because the process keeps the modules that it has imported: a worker that was started
    before a change must not deliver tiles under the new hash.
    """
    from renderer.sampling import POINT_SETS
    from scenes import catalog

    added = brought((POINT_SETS, point_set))
    return content_hash((catalog.load_seen(scene, look)[0], code_hash(render_chunk), *added))


def picture_of(options: TileOptions, threads: int) -> PictureTask:
    """The requested picture.

    Raises:
        ValueError: there is no such scene, the point set cannot have this number of points, the pixels do not fit into
            memory, or the crop does not lie within the picture.
    """
    from renderer.sampling.point_sets import point_set
    from renderer.tables.checks import check_frame_size
    from scenes import catalog

    film = catalog.load_seen(options.scene, options.look)[0].film
    point_set(options.point_set, options.samples)
    size = options.size_px((film.width_px, film.height_px))
    check_frame_size(*size, 1)
    kinds = options.samples, options.point_set, options.space_filter
    source = source_of(options.scene, options.look, options.point_set)
    place = options.time_s, options.seed, threads, source
    return PictureTask(options.scene, options.look, size, options.crop, *kinds, *place)


def chunks_of(picture: PictureTask, chunk_tiles: int) -> list[list[int]]:
    """The tiles of a picture, or of its crop, in groups, row by row."""
    from renderer.frames import tiles_of

    tiles = tiles_of(picture.crop or (0, 0, *picture.size_px), picture.size_px[0])
    return [tiles[first : first + chunk_tiles] for first in range(0, len(tiles), chunk_tiles)]


@lru_cache(maxsize=1)
def _renderer(scene: str, look: Look, seed: int, threads: int) -> Renderer:
    """A renderer of a scene, which a process builds once for all of its chunks."""
    from renderer.trace import Renderer
    from scenes import catalog

    return Renderer(catalog.load_seen(scene, look)[0], threads=threads, seed=seed)


def render_chunk(picture: PictureTask, tiles: Sequence[int]) -> tuple[NDArray[np.float32], dict[str, int], float]:
    """Pixels ``(tiles, 256, 3)`` of some tiles, counts of their rays, and seconds without building the scene.

    Raises:
        ValueError: this process has another source or another scene than the process that asked.
    """
    from renderer.frames import render_tiles
    from renderer.sampling.plan import SamplePlan

    if picture.source != source_of(picture.scene, picture.look, picture.point_set):
        raise ValueError(f"{picture.scene}: {OTHER_SOURCE}")
    renderer = _renderer(picture.scene, picture.look, picture.seed, picture.threads)
    plan = SamplePlan(picture.samples, picture.point_set, picture.seed, picture.space_filter)  # type: ignore[arg-type]
    start = time.perf_counter()
    colors, rays = render_tiles(renderer, plan, tiles, picture.size_px, picture.time_s, renderer.shutter_s)
    return colors.numpy(), rays, time.perf_counter() - start


def rendered(
    client: Client,
    picture: PictureTask,
    chunks: Sequence[Sequence[int]],
    workers: Sequence[str] | None = None,
    retries: int = _RETRIES,
) -> Iterator[tuple[int, tuple[NDArray[np.float32], dict[str, int], float]]]:
    """Renders chunks on a cluster, in any order; if a worker dies, others render its chunks again.

    Args:
        client: client of the cluster.
        picture: the picture.
        chunks: runs of tiles.
        workers: addresses of the workers to use; None for all.
        retries: number of times that a chunk that failed is tried again.

    Yields:
        The number of a chunk and the result of :func:`render_chunk`.
    """
    from distributed import as_completed

    futures = {
        client.submit(render_chunk, picture, chunk, pure=False, retries=retries, workers=workers): number
        for number, chunk in enumerate(chunks)
    }
    for future, result in as_completed(list(futures), with_results=True, raise_errors=True):
        yield futures[future], result
        future.release()


def assembled(picture: PictureTask, chunks: Sequence[Sequence[int]], pixels: Sequence[NDArray[np.float32]]) -> Tensor:
    """The picture or its crop, linear radiance ``(h, w, 3)``."""
    import torch

    from renderer.frames import cut, place_tiles

    width, height = picture.size_px
    image = torch.zeros(height, width, 3)
    for chunk, part in zip(chunks, pixels, strict=True):
        place_tiles(image, chunk, torch.as_tensor(part))
    return cut(image, picture.crop)


def render_resumed(
    client: Client, picture: PictureTask, options: TileOptions, task: Task
) -> tuple[Tensor, dict[str, Any]]:
    """Renders the chunks that an interrupted run of the same picture has not left on disk, and assembles the picture.

    Args:
        client: client of the cluster.
        picture: the picture.
        options: options of the command.
        task: progress, one step a chunk.

    Returns:
        The picture, and facts about its rendering.

    Raises:
        ValueError: a foreign file has the name of a chunk, or a chunk was changed right after it was written.
    """
    store = Store(options.out / "chunks", content_hash((picture.content, options.chunk_tiles)))
    chunks = chunks_of(picture, options.chunk_tiles)
    names = [f"chunk{number:06d}.npz" for number in range(len(chunks))]
    store.require_own(names)
    missing = [number for number, name in enumerate(names) if store.find(name) is None]
    task.reach(len(chunks) - len(missing))
    start = time.perf_counter()
    retries = options.farm.retries or _RETRIES
    found = rendered(client, picture, [chunks[number] for number in missing], retries=retries)
    for place, (pixels, rays, seconds) in found:
        with store.make(names[missing[place]]) as making:
            np.savez(making.path, pixels=pixels, seconds=seconds, kinds=list(rays), rays=list(rays.values()))
        task.advance()
    wall_s, rays, seconds, parts = time.perf_counter() - start, Counter[str](), 0.0, []
    for name in names:
        content = store.read(name)
        if content is None:
            raise ValueError(f"{store.folder / name}: expected the chunk that was written, found another")
        with np.load(io.BytesIO(content)) as stored:
            parts.append(stored["pixels"])
            rays.update(dict(zip(stored["kinds"].tolist(), stored["rays"].tolist(), strict=True)))
            seconds += float(stored["seconds"])
    store.discard_outdated("chunk*")
    facts = {"chunks": len(chunks), "chunks_rendered_now": len(missing), "wall_s": wall_s, "worker_s": seconds}
    return assembled(picture, chunks, parts), {**facts, "rays": dict(rays)}
