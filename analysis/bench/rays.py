"""Groups coherent and incoherent: rays per second beside Embree, one thread each, on the same rays.

Time is CPU time of the thread that asks: Embree's other threads may spin. The peer is the fastest of its modes for each
question.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.bench.embree import MODES, EmbreeMesh, EmbreexMesh, Mode, missing
from analysis.bench.machine import installed, uses_avx512
from analysis.bench.options import BenchOptions
from analysis.bench.rows import NOT_INSTALLED, Row, rate_row
from analysis.bench.scenes import LIGHT, bumpy_sphere, camera_rays, morton_batches
from analysis.command.timing import take_turns
from scenes.canonical import Mesh

if TYPE_CHECKING:
    from analysis.command.progress import Bars, Task
    from renderer.rays.queries import RayQueries

TARGETS = {"camera rays": 2.0, "shadow rays": 1.5, "glossy bounces": 1.0, "random directions": 1.0}
"""Least ratio to the fastest of Embree's modes."""
GLOSSY_AVX512 = 1.1
"""The same for glossy bounces where AVX-512 is used."""

_OFFSET = 1.0e-4  # in units of the mesh's size, from the surface to the origin of a secondary ray
_JITTER = 0.15  # of a glossy mirror: about the width of a Phong lobe of exponent 100
_REACH = 0.9999  # a shadow ray ends short of its light
_SAME_DISTANCE = 1.0e-4

Points = NDArray[np.float32]


@dataclass(frozen=True)
class Rays:
    """Rays ``(n, 3)`` of one call: any hit nearer than ``t_max`` ``(n,)`` where it is given, else the closest hit."""

    origin: Points
    direction: Points
    t_max: Points | None = None

    @property
    def count(self) -> int:
        """Number of rays."""
        return len(self.origin)


@dataclass(frozen=True)
class Question:
    """Calls whose time is compared; one row of the table."""

    name: str
    calls: list[Rays]


def coherent(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Closest hits of framelet batches, and shadow rays from these hits towards one light."""
    yield from _rows("coherent", _coherent_questions, options, bars)


def incoherent(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Glossy bounces off the camera's hits, and random directions from within the mesh's bounding box."""
    yield from _rows("incoherent", _incoherent_questions, options, bars)


Ask = Callable[[Mesh, "RayQueries", BenchOptions], list[Question]]


def _rows(group: str, ask: Ask, options: BenchOptions, bars: Bars) -> Iterator[Row]:
    from renderer.rays.queries import RayQueries

    task = bars.task(group, 2 * len(options.subdivisions) * options.repetitions)
    for subdivisions in options.subdivisions:
        mesh = bumpy_sphere(subdivisions)
        ours = RayQueries(mesh.vertices, mesh.faces, threads=1)
        peer = EmbreexMesh(mesh.vertices, mesh.faces) if installed("embreex") else None
        embree = EmbreeMesh(mesh.vertices, mesh.faces, options.isa) if not missing() else None
        for question in ask(mesh, ours, options):
            target = TARGETS[question.name]
            if question.name == "glossy bounces" and uses_avx512(options.isa):
                target = GLOSSY_AVX512
            row = Row(group, f"{question.name}, {len(mesh.faces):,} triangles", "M rays/s", 0.0, target=target)
            yield compare(row, question, ours, peer, embree, options.repetitions, task)


def compare(
    row: Row,
    question: Question,
    ours: RayQueries,
    peer: EmbreexMesh | None,
    embree: EmbreeMesh | None,
    repetitions: int,
    task: Task,
) -> Row:
    """Fills a row: all sides answer all calls of a question in turns, and the fastest peer counts.

    Args:
        row: group, name, unit and target.
        question: the calls.
        ours, peer, embree: our side, embreex, and Embree's own interface; None where a peer is missing.
        repetitions: turns of each.
        task: progress that advances by one step a round.
    """
    answers: dict[str, Callable[[Rays], object]] = {"ours": lambda rays: _ask(ours, rays)}
    note = NOT_INSTALLED if embree is None else ""
    if peer is not None:
        answers["embreex"] = lambda rays: _ask(peer, rays)
        wrong = sum(disagreements(ours, peer, rays) for rays in question.calls)
        note = f"{wrong} of {sum(rays.count for rays in question.calls):,} rays disagree"
    if embree is not None:
        answers |= {mode.name: _asking(embree, mode) for mode in MODES}
    seconds = take_turns(
        {name: _all_calls(answer, question) for name, answer in answers.items()}, repetitions, task,
        clock=time.thread_time,
    )  # fmt: skip
    work = sum(rays.count for rays in question.calls) / 1e6
    peers = {name: median(taken) for name, taken in seconds.items() if name != "ours"}
    best = min(peers, key=peers.__getitem__, default="")
    others = [f"{name} {work / taken:.3g}" for name, taken in peers.items() if name != best]
    without = f"without Embree's own modes: {missing()}" if peer is not None and embree is None else ""
    row = dataclasses.replace(row, peer_name=best, note="; ".join(part for part in (note, *others, without) if part))
    return rate_row(row, work, seconds["ours"], seconds.get(best), row.target)


def _all_calls(answer: Callable[[Rays], object], question: Question) -> Callable[[], object]:
    return lambda: [answer(rays) for rays in question.calls]


def _asking(embree: EmbreeMesh, mode: Mode) -> Callable[[Rays], object]:
    def asked(rays: Rays) -> object:
        if rays.t_max is None:
            return embree.closest(mode, rays.origin, rays.direction)
        return embree.blocked(mode, rays.origin, rays.direction, rays.t_max)

    return asked


def _ask(side: Any, rays: Rays) -> object:
    if rays.t_max is None:
        return side.closest(rays.origin, rays.direction)
    return side.blocked(rays.origin, rays.direction, rays.t_max)


def disagreements(ours: RayQueries, peer: EmbreexMesh, rays: Rays) -> int:
    """Rays of which one side alone hits something, or the two hit at different distances.

    Faces are not compared: on an edge shared by two faces, either is right.
    """
    if rays.t_max is not None:
        theirs = peer.blocked(rays.origin, rays.direction, rays.t_max) >= 0
        return int((np.asarray(ours.blocked(rays.origin, rays.direction, rays.t_max)) != theirs).sum())
    face, distance = peer.hits(rays.origin, rays.direction)
    mine = ours.closest(rays.origin, rays.direction)
    both = (mine.face >= 0) & (face >= 0)
    far = np.abs(mine.t - distance) > _SAME_DISTANCE * np.maximum(distance, 1.0)
    return int((((mine.face >= 0) != (face >= 0)) | (both & far)).sum())


def framelet_calls(options: BenchOptions) -> list[Rays]:
    """Camera rays of all batches of a picture."""
    return [Rays(*camera_rays(batch)) for batch in morton_batches(options, 0.0)]


def seen(mesh: Mesh, ours: RayQueries, rays: Rays) -> tuple[Points, Points, NDArray[np.bool_]]:
    """Points ``(m, 3)`` just above the surfaces that rays hit, unit normals there, and which of the rays hit."""
    found = ours.closest(rays.origin, rays.direction)
    hit = np.asarray(found.face) >= 0
    corners = mesh.vertices[mesh.faces[found.face[hit]]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    point = rays.origin[hit] + found.t[hit, None] * rays.direction[hit] + _OFFSET * size * normal
    return point.astype(np.float32), normal.astype(np.float32), hit


def shadow_rays(mesh: Mesh, ours: RayQueries, rays: Rays) -> Rays:
    """Rays from hits to the light, where the surface faces it; their direction vector ends at the light."""
    point, normal, _ = seen(mesh, ours, rays)
    direction = np.asarray(LIGHT, np.float32) - point
    lit = np.einsum("ij,ij->i", direction, normal) > 0.0
    return Rays(point[lit], direction[lit], np.full(int(lit.sum()), _REACH, np.float32))


def glossy_bounces(mesh: Mesh, ours: RayQueries, rays: Rays, generator: np.random.Generator) -> Rays:
    """Rays mirrored where they hit, each turned a little at random and kept above the surface."""
    point, normal, hit = seen(mesh, ours, rays)
    towards = rays.direction[hit]
    mirrored = towards - 2.0 * np.einsum("ij,ij->i", towards, normal)[:, None] * normal
    mirrored = mirrored + _JITTER * generator.standard_normal(mirrored.shape)
    below = np.minimum(np.einsum("ij,ij->i", mirrored, normal), 0.0)
    mirrored = mirrored - 2.0 * below[:, None] * normal
    mirrored /= np.linalg.norm(mirrored, axis=1, keepdims=True)
    return Rays(point, mirrored.astype(np.float32))


def random_rays(mesh: Mesh, count: int, generator: np.random.Generator) -> Rays:
    """Rays in all directions from points all over the mesh's bounding box."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    direction = generator.standard_normal((count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return Rays(generator.uniform(low, high, (count, 3)).astype(np.float32), direction.astype(np.float32))


def _coherent_questions(mesh: Mesh, ours: RayQueries, options: BenchOptions) -> list[Question]:
    calls = framelet_calls(options)
    shadows = [shadow_rays(mesh, ours, rays) for rays in calls]
    return [Question("camera rays", calls), Question("shadow rays", shadows)]


def _incoherent_questions(mesh: Mesh, ours: RayQueries, options: BenchOptions) -> list[Question]:
    generator = np.random.default_rng(0)
    calls = framelet_calls(options)
    bounces = [glossy_bounces(mesh, ours, rays, generator) for rays in calls]
    scattered = [random_rays(mesh, rays.count, generator) for rays in calls]
    return [Question("glossy bounces", bounces), Question("random directions", scattered)]
