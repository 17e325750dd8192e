"""Speed-up of rendering a picture with more workers, its limits, and a prediction for twenty workers."""

from __future__ import annotations

import heapq
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.command.progress import Task
from analysis.tracer.tiles import PictureTask, assembled, rendered
from tsar.memory import core_count

if TYPE_CHECKING:
    from distributed import Client

REPORTED = {"report-one": 5210.0 / 320.0, "report-two": 8240.0 / 610.0}
"""Speed-up with 20 processes that the ray-tracer report gives for its two images: 16.3 and 13.5."""

PREDICTED_WORKERS = 20


@dataclass(frozen=True)
class FarmModel:
    """Model of the time of a picture on a number of workers.

    Workers take chunks in order, each as soon as it is free (list scheduling). A chunk occupies its worker for its
    rendering time, times ``contention`` if others render at the same time, plus ``overhead_s`` of scheduling and
    transfer. The scheduler hands out the chunks one by one, ``dispatch_s`` apart; the picture is assembled at the end.
    Workers beyond the number of cores share the cores.

    Attributes:
        chunk_s: time of each chunk alone, seconds.
        overhead_s: overhead of a chunk on its worker, seconds.
        dispatch_s: time of a chunk on the scheduler, seconds.
        assembly_s: time of the assembly, seconds.
        contention: factor on the time of a chunk while others render, at least 1.
        cores: number of cores of the machine or machines.
    """

    chunk_s: NDArray[np.float64]
    overhead_s: float
    dispatch_s: float
    assembly_s: float
    contention: float
    cores: int

    def seconds(self, workers: int, cores: int | None = None) -> float:
        """Seconds of the picture, on ``cores`` cores if given, else on those of the model."""
        sharing = max(1.0, workers / (cores or self.cores)) * (self.contention if workers > 1 else 1.0)
        free = [0.0] * workers
        heapq.heapify(free)
        for number, alone in enumerate(self.chunk_s):
            start = max(heapq.heappop(free), (number + 1) * self.dispatch_s)
            heapq.heappush(free, start + alone * sharing + self.overhead_s)
        return max(free) + self.assembly_s

    def speedup(self, workers: int, cores: int | None = None) -> float:
        """Speed-up over one worker."""
        return self.seconds(1) / self.seconds(workers, cores)


def fitted(
    chunk_s: Sequence[float], wall_s: dict[int, float], beside_s: Sequence[float], dispatch_s: float, assembly_s: float
) -> FarmModel:
    """A model from measurements.

    Args:
        chunk_s: seconds of each chunk on a worker that renders alone.
        wall_s: seconds of the whole picture, by number of workers; that of one worker gives the overhead per chunk.
        beside_s: seconds of each chunk on several workers, at most as many as there are cores.
        dispatch_s: seconds from one empty chunk to the next, all workers idle.
        assembly_s: seconds to put the picture together.
    """
    alone = np.asarray(chunk_s, np.float64)
    contention = max(1.0, float(np.sum(beside_s) / alone.sum()))
    rest = wall_s[1] - alone.sum() - assembly_s
    cores = core_count()
    return FarmModel(alone, max(0.0, rest / len(alone)), dispatch_s, assembly_s, contention, cores)


def _nothing(shape: tuple[int, ...]) -> NDArray[np.float32]:
    return np.zeros(shape, np.float32)


def _dispatch_s(client: Client, chunks: Sequence[Sequence[int]], workers: Sequence[str]) -> float:
    """Seconds per chunk to hand out work that takes no time, and to fetch as many bytes back."""
    from distributed import as_completed

    start = time.perf_counter()
    futures = [client.submit(_nothing, (len(chunk), 256, 3), pure=False, workers=workers) for chunk in chunks]
    for _ in as_completed(futures, with_results=True):
        pass
    return (time.perf_counter() - start) / len(chunks)


def study(
    client: Client,
    picture: PictureTask,
    chunks: Sequence[Sequence[int]],
    counts: Sequence[int],
    repetitions: int,
    task: Task,
) -> dict[str, Any]:
    """Times a picture on subsets of a cluster's workers, in turns, fits the model and makes its prediction.

    Args:
        client: client of a local cluster with as many workers as the greatest count.
        picture: the picture.
        chunks: runs of tiles.
        counts: numbers of workers; 1 is always added.
        repetitions: turns of each.
        task: progress, one step a turn.

    Returns:
        Rows for tables, the parameters of the model, and whether all pictures have the same bits.
    """
    addresses = sorted(client.scheduler_info(n_workers=-1)["workers"])
    wanted = sorted({1, *counts})
    build_s = []
    for address in addresses:  # every worker builds the scene once
        start = time.perf_counter()
        for _ in rendered(client, picture, chunks[:1], [address]):
            pass
        build_s.append(time.perf_counter() - start)
    wall_s: dict[int, list[float]] = {count: [] for count in wanted}
    worker_s: dict[int, list[NDArray[np.float64]]] = {count: [] for count in wanted}
    assembly_s, images = [], []
    for turn in range(repetitions):
        for count in wanted if turn % 2 == 0 else wanted[::-1]:
            start = time.perf_counter()
            found = dict(rendered(client, picture, chunks, addresses[:count]))
            joining = time.perf_counter()
            image = assembled(picture, chunks, [found[number][0] for number in range(len(chunks))])
            end = time.perf_counter()
            wall_s[count].append(end - start)
            assembly_s.append(end - joining)
            worker_s[count].append(np.array([found[number][2] for number in range(len(chunks))]))
            images.append(image.numpy().tobytes())
            task.advance()
    medians = {count: median(values) for count, values in wall_s.items()}
    chunk_s = {count: np.median(np.stack(values), axis=0) for count, values in worker_s.items()}
    cores = core_count()
    beside = max((count for count in wanted if count <= cores), default=1)
    dispatch = median(_dispatch_s(client, chunks, addresses) for _ in range(3))
    model = fitted(chunk_s[1].tolist(), medians, chunk_s[beside].tolist(), dispatch, median(assembly_s))
    rows = [_row(count, wall_s[count], medians[1], model) for count in wanted]
    return {
        "rows": rows,
        "same_bits": len(set(images)) == 1,
        "model": {
            "chunks": len(chunks),
            "chunk_s_mean": float(model.chunk_s.mean()),
            "chunk_s_greatest": float(model.chunk_s.max()),
            "overhead_s": model.overhead_s,
            "dispatch_s": model.dispatch_s,
            "assembly_s": model.assembly_s,
            "contention": model.contention,
            "cores": model.cores,
            "first_chunk_s": median(build_s),
        },
        "predicted": {
            "workers": PREDICTED_WORKERS,
            "speedup": model.speedup(PREDICTED_WORKERS, PREDICTED_WORKERS),
            "efficiency": model.speedup(PREDICTED_WORKERS, PREDICTED_WORKERS) / PREDICTED_WORKERS,
            "reported": REPORTED.get(picture.scene),
        },
    }


def _row(count: int, seconds: Sequence[float], one_s: float, model: FarmModel) -> dict[str, Any]:
    return {
        "workers": count,
        "wall_s": median(seconds),
        "fastest_s": min(seconds),
        "slowest_s": max(seconds),
        "speedup": one_s / median(seconds),
        "efficiency": one_s / median(seconds) / count,
        "modelled_s": model.seconds(count),
        "modelled_over_measured": model.seconds(count) / median(seconds),
    }


def described(found: Mapping[str, Any]) -> str:
    """The result of a study, in one line."""
    predicted, reported = found["predicted"], found["predicted"]["reported"]
    beside = f" (report: {reported:.1f})" if reported else ""
    return (
        f"same bits from all: {found['same_bits']}; by the model {predicted['workers']} workers with a core each are "
        f"{predicted['speedup']:.1f} times as fast as one{beside}"
    )
