"""A picture in tiles over processes or machines: the same bits in whatever order and wherever tiles are rendered."""

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

from analysis.command.progress import Task
from analysis.storage.reference import content_hash
from analysis.storage.source import brought, code_hash
from analysis.storage.store import Store
from analysis.tracer.options import TileOptions

if TYPE_CHECKING:
    from distributed import Client
    from torch import Tensor

    from renderer.trace import Renderer

_RETRIES = 5


@dataclass(frozen=True)
class Picture:
    """What to render, in full: small enough to send with every chunk."""

    scene: str
    size_px: tuple[int, int]
    samples: int
    point_set: str
    space_filter: str
    time_s: float
    seed: int
    threads: int
    source: str
    """:func:`source_of` the scene."""

    @property
    def name(self) -> str:
        """Of its files: that of the scene, without folder and ending where it is one of a file."""
        return Path(self.scene).stem

    @property
    def content(self) -> dict[str, Any]:
        """What decides the bits: all but the threads."""
        return {name: value for name, value in dataclasses.asdict(self).items() if name != "threads"}


@lru_cache(maxsize=4)
def source_of(scene: str, point_set: str) -> str:
    """Hash of the content of a scene and of the code that renders it with a point set.

    It is taken once in a process, because the process keeps the modules that it has imported: a worker that was started
    before a change must not deliver tiles under the new hash.
    """
    from renderer.sampling import POINT_SETS
    from scenes import catalog

    added = brought((POINT_SETS, point_set))
    return content_hash((catalog.load_any(scene)[0], code_hash(render_chunk), *added))


def picture_of(options: TileOptions, threads: int) -> Picture:
    """The picture asked for.

    Raises:
        ValueError: there is no such scene, the point set cannot have so many points, or memory does not hold so many
            pixels.
    """
    from renderer.sampling.point_sets import point_set
    from renderer.tables.checks import check_frame_size
    from scenes import catalog

    film = catalog.load_any(options.scene)[0].film
    point_set(options.point_set, options.samples)
    size = options.width_px or film.width_px, options.height_px or film.height_px
    check_frame_size(*size, 1)
    kinds = options.samples, options.point_set, options.space_filter
    return Picture(
        options.scene, size, *kinds, options.time_s, options.seed, threads, source_of(options.scene, options.point_set)
    )


def chunks_of(picture: Picture, chunk_tiles: int) -> list[range]:
    """The tiles of a picture in runs."""
    from renderer.frames import tile_count

    count = tile_count(*picture.size_px)
    return [range(first, min(first + chunk_tiles, count)) for first in range(0, count, chunk_tiles)]


@lru_cache(maxsize=1)
def _renderer(scene: str, seed: int, threads: int) -> Renderer:
    """A process builds a scene once, however many chunks of it it is handed."""
    from renderer.trace import Renderer
    from scenes import catalog

    return Renderer(catalog.load_any(scene)[0], threads=threads, seed=seed)


def render_chunk(picture: Picture, tiles: Sequence[int]) -> tuple[NDArray[np.float32], dict[str, int], float]:
    """Pixels ``(tiles, 256, 3)`` of some tiles, the rays they took, and seconds without building the scene.

    Raises:
        ValueError: this process runs another source, or knows another scene, than the one that asked.
    """
    from renderer.frames import render_tiles
    from renderer.sampling.plan import SamplePlan

    if picture.source != source_of(picture.scene, picture.point_set):
        raise ValueError(f"{picture.scene}: expected source {picture.source[:16]}, this worker runs another one")
    renderer = _renderer(picture.scene, picture.seed, picture.threads)
    plan = SamplePlan(picture.samples, picture.point_set, picture.seed, picture.space_filter)  # type: ignore[arg-type]
    start = time.perf_counter()
    colors, rays = render_tiles(renderer, plan, tiles, picture.size_px, picture.time_s, renderer.shutter_s)
    return colors.numpy(), rays, time.perf_counter() - start


def rendered(
    client: Client, picture: Picture, chunks: Sequence[range], workers: Sequence[str] | None = None
) -> Iterator[tuple[int, tuple[NDArray[np.float32], dict[str, int], float]]]:
    """Renders chunks on a cluster, in any order; those of a worker that dies are done again by others.

    Args:
        client: of the cluster.
        picture: what to render.
        chunks: runs of tiles.
        workers: addresses of the only workers to use.

    Yields:
        The number of a chunk and what :func:`render_chunk` returned.
    """
    from distributed import as_completed

    futures = {
        client.submit(render_chunk, picture, chunk, pure=False, retries=_RETRIES, workers=workers): number
        for number, chunk in enumerate(chunks)
    }
    for future, result in as_completed(list(futures), with_results=True, raise_errors=True):
        yield futures[future], result
        future.release()


def assembled(picture: Picture, chunks: Sequence[range], pixels: Sequence[NDArray[np.float32]]) -> Tensor:
    """The picture, linear radiance ``(h, w, 3)``."""
    import torch

    from renderer.frames import place_tiles

    width, height = picture.size_px
    image = torch.zeros(height, width, 3)
    for chunk, part in zip(chunks, pixels, strict=True):
        place_tiles(image, chunk, torch.as_tensor(part))
    return image


def render_resumed(client: Client, picture: Picture, options: TileOptions, task: Task) -> tuple[Tensor, dict[str, Any]]:
    """Renders what an interrupted run of the same picture has not left on disk, and puts the picture together.

    Args:
        client: of the cluster.
        picture: what to render.
        options: of the command.
        task: of which a step is a chunk.

    Returns:
        The picture, and how it came about.

    Raises:
        ValueError: a file of another origin lies where a chunk belongs, or one was changed as soon as it was written.
    """
    store = Store(options.out / "chunks", content_hash((picture.content, options.chunk_tiles)))
    chunks = chunks_of(picture, options.chunk_tiles)
    names = [f"chunk{number:06d}.npz" for number in range(len(chunks))]
    store.require_own(names)
    missing = [number for number, name in enumerate(names) if store.find(name) is None]
    task.reach(len(chunks) - len(missing))
    start = time.perf_counter()
    for place, (pixels, rays, seconds) in rendered(client, picture, [chunks[number] for number in missing]):
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
