"""Group large: meshes of ten million triangles, many instances of a large mesh, and cycles at 4096² pixels."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import get_context
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from analysis.bench.cycles import RunningPipeline, synthetic_trace
from analysis.bench.embree import EmbreeMesh, missing
from analysis.bench.growth import exponent, exponent_row
from analysis.bench.options import BenchOptions
from analysis.bench.rays import Question, compare, framelet_calls, random_rays
from analysis.bench.rows import Row, rate_row, spread_of
from analysis.bench.scenes import EYE, FOV_DEG, bumpy_globe
from analysis.command.cli import InputError
from analysis.command.timing import take_turns
from scenes.canonical import (
    ConstantTexture,
    Instance,
    Integrator,
    Matte,
    Mesh,
    PerspectiveCamera,
    PointLight,
    Scene,
    identity,
)
from tsar.config import TsarConfig

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from analysis.command.progress import Bars, Task
    from renderer.rays.queries import RayQueries

TRIANGLES = (160_000, 640_000, 2_560_000, 10_240_000)
INSTANCES = (1, 4, 16, 64)
INSTANCE_TRIANGLES = 1_000_000
CYCLES = ((512, 64), (1024, 256), (2048, 1024), (4096, 4096))
"""Sides of pictures, pixels, with batches in proportion to their pixels."""
_BUILDS = 3
_WARMUP_CYCLES = 16
_INSTANCES_PX = 256


def large(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """All rows of the group."""
    yield from mesh_rows(options, bars.task("meshes", len(TRIANGLES)), TRIANGLES)
    yield memory_row(TRIANGLES[-1])
    yield from instance_rows(options, bars.task("instances", len(INSTANCES)), INSTANCE_TRIANGLES, INSTANCES)
    yield cycle_row(options, bars.task("cycles", options.repetitions), CYCLES)


def mesh_rows(options: BenchOptions, task: Task, sizes: Sequence[int]) -> Iterator[Row]:
    """Trees of growing meshes, and rays through them; the largest beside Embree. CPU time of one thread."""
    from renderer.rays.queries import RayQueries

    builds: list[list[float]] = []
    traced: dict[str, list[list[float]]] = {}
    for size in sizes:
        mesh = bumpy_globe(size)
        seconds, ours = _timed(lambda mesh=mesh: RayQueries(mesh.vertices, mesh.faces, threads=1))
        builds.append(seconds)
        calls = framelet_calls(options)
        scattered = random_rays(mesh, sum(rays.count for rays in calls), np.random.default_rng(0))
        questions = [Question("camera rays", calls), Question("random directions", [scattered])]
        for question in questions:
            found = take_turns({"": _asking(ours, question)}, options.repetitions, clock=time.thread_time)
            traced.setdefault(question.name, []).append(found[""])
        if size == sizes[-1]:
            yield from _beside_embree(mesh, seconds, ours, questions, options)
        task.advance()
    span = f"{sizes[0]:,} to {sizes[-1]:,} triangles"
    yield dataclasses.replace(exponent_row(f"building trees of {span}", sizes, builds), group="large")
    for name, seconds in traced.items():
        yield _exponent(f"{name} through {span}", sizes, seconds)


def _timed(build: Callable[[], RayQueries]) -> tuple[list[float], RayQueries]:
    seconds = []
    for _ in range(_BUILDS):
        begin = time.thread_time()
        built = build()
        seconds.append(time.thread_time() - begin)
    return seconds, built


def _asking(ours: RayQueries, question: Question) -> Callable[[], object]:
    return lambda: [ours.closest(rays.origin, rays.direction) for rays in question.calls]


def _beside_embree(
    mesh: Mesh, seconds: list[float], ours: RayQueries, questions: list[Question], options: BenchOptions
) -> Iterator[Row]:
    """Building a tree, and rays, beside Embree where it is installed."""
    from analysis.command.progress import Task

    theirs: list[float] = []
    embree = None
    while not missing() and len(theirs) < _BUILDS:
        begin = time.thread_time()  # it builds on this thread; those of an earlier device may spin
        embree = EmbreeMesh(mesh.vertices, mesh.faces, options.isa)
        theirs.append(time.thread_time() - begin)
    size = f"{len(mesh.faces):,} triangles"
    row = Row("large", f"building a tree, {size}", "M triangles/s", 0.0, "Embree" if theirs else "", note=missing())
    yield rate_row(row, len(mesh.faces) / 1e6, seconds, theirs or None)
    for question in questions:
        row = Row("large", f"{question.name}, {size}", "M rays/s", 0.0)
        yield compare(row, question, ours, None, embree, options.repetitions, Task())


def _exponent(name: str, sizes: Sequence[float], seconds: Sequence[Sequence[float]]) -> Row:
    """A growth exponent without a limit; ``seconds`` are those of every round, of each size."""
    note = ", ".join(f"{size:,}: {1e3 * median(found):.3g} ms" for size, found in zip(sizes, seconds, strict=True))
    found = [exponent(sizes, one) for one in zip(*seconds, strict=True)]
    row = Row("large", name, "exponent", median(found), repetitions=len(found), less_is_better=True, note=note)
    return dataclasses.replace(row, spread=spread_of(found))


def memory_row(triangles: int) -> Row:
    """Peak memory while a tree is built, beyond the mesh, in a process of its own."""
    context = get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_build_watched, args=(sender, triangles), daemon=True)
    process.start()
    sender.close()
    try:
        count, before, peak, kept = receiver.recv()
    except EOFError:
        raise InputError("large: the process whose memory is watched ended early") from None
    finally:
        process.join()
    note = f"beyond mesh and libraries, {before / 2**20:,.0f} MiB; the tree itself {kept / count:.1f} bytes a triangle"
    name = f"peak memory of building a tree, {count:,} triangles"
    return Row("large", name, "bytes a triangle", (peak - before) / count, less_is_better=True, note=note)


def _build_watched(sender: Connection, triangles: int) -> None:
    import signal

    from analysis.study.memory import PeakMemory
    from renderer.tables.trees import build_tree

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends it
    build_tree(*_arrays(bumpy_globe(1000)))  # loads kernels
    mesh = bumpy_globe(triangles)
    with PeakMemory() as peak:
        tree = build_tree(*_arrays(mesh))
    sender.send((len(mesh.faces), peak.bytes - peak.grown, peak.bytes, tree.nodes.nbytes + tree.blocks.nbytes))
    sender.close()


def _arrays(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    return mesh.vertices, mesh.faces


def instance_rows(options: BenchOptions, task: Task, triangles: int, counts: Sequence[int]) -> Iterator[Row]:
    """Scenes of more and more instances of one mesh: time to prepare them, and to render a picture; CPU time of one
    thread."""
    from renderer.trace import Renderer

    mesh = bumpy_globe(triangles)
    Renderer(instances(bumpy_globe(1000), 1), threads=1)  # loads kernels
    prepared: list[list[float]] = []
    drawn: list[list[float]] = []
    for count in counts:
        scene = instances(mesh, count)
        seconds = []
        for _ in range(_BUILDS):
            begin = time.thread_time()
            renderer = Renderer(scene, threads=1)
            seconds.append(time.thread_time() - begin)
        prepared.append(seconds)
        picture = {"": lambda renderer=renderer: renderer.render_frame(0.0, _INSTANCES_PX, _INSTANCES_PX, 2)}
        drawn.append(take_turns(picture, options.repetitions, clock=time.thread_time)[""])
        task.advance()
    span = f"{counts[0]} to {counts[-1]} instances of {len(mesh.faces):,} triangles"
    yield _exponent(f"preparing {span}", counts, prepared)
    yield _exponent(f"a picture of {span}", counts, drawn)
    rate = Row("large", f"samples of {counts[-1]} instances of {len(mesh.faces):,} triangles", "M samples/s", 0.0)
    yield rate_row(rate, 4 * _INSTANCES_PX**2 / 1e6, drawn[-1], None)


def instances(mesh: Mesh, count: int) -> Scene:
    """Instances of a mesh side by side in a square that fills the picture, each turned in its own way."""
    from scipy.spatial.transform import Rotation

    side = round(count**0.5)
    placed = []
    for number in range(count):
        pose = identity()
        pose[:3, :3] = Rotation.from_euler("y", number).as_matrix() / side
        pose[:2, 3] = (2.0 * np.array(divmod(number, side)) + 1.0) / side - 1.0
        placed.append(Instance(mesh, Matte(ConstantTexture((0.62, 0.5, 0.4))), pose, name=f"globe {number}"))
    eye = identity()
    eye[:3, 3] = EYE
    light = PointLight((1.5, 2.5, 4.5), (60.0, 57.0, 51.0))
    return Scene(PerspectiveCamera(eye, FOV_DEG), tuple(placed), (light,), integrator=Integrator("direct", depth=0))


def cycle_config(side: int, batch: int) -> TsarConfig:
    """Settings of a cycle at so many pixels along a side; the cache holds as many batches as by default."""
    cached = TsarConfig.cache_size // TsarConfig.batch_size * batch
    return TsarConfig(batch_size=batch, resolution_px=side, cache_size=cached, warmup_cycles=_WARMUP_CYCLES)


def cycle_row(options: BenchOptions, task: Task, cases: Sequence[tuple[int, int]]) -> Row:
    """Time of a whole cycle against pixels, on all cores, with batches in proportion."""
    running = {str(side): RunningPipeline(cycle_config(side, batch), synthetic_trace, 1) for side, batch in cases}
    take_turns(running, options.repetitions, task)
    rounds = [[sum(turn[0].values()) for turn in case.turns()] for case in running.values()]
    least, most = cases[0], cases[-1]
    name = f"a cycle from {least[0]}², batch {least[1]}, to {most[0]}², batch {most[1]}, against pixels"
    return dataclasses.replace(exponent_row(name, [side**2 for side, _ in cases], rounds), group="large")
