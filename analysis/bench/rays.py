"""Groups coherent and incoherent: rays per second beside Embree, one thread each, on the same rays."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.bench.embree import EmbreeMesh
from analysis.bench.machine import installed
from analysis.bench.options import BenchOptions
from analysis.bench.rows import NOT_INSTALLED, Row, rate_row
from analysis.bench.scenes import LIGHT, bumpy_sphere, camera_rays, morton_batches
from analysis.command.timing import take_turns
from scenes.canonical import Mesh

if TYPE_CHECKING:
    from analysis.command.progress import Bars, Task
    from renderer.rays.queries import RayQueries

CLOSEST_TARGETS = {5: 3.0, 8: 2.0}
"""Least ratio of closest hits by subdivisions: meshes of 20 thousand and of a million triangles."""

SHADOW_TARGET, INCOHERENT_TARGET = 2.0, 0.8

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
    target: float | None


def coherent(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Closest hits of framelet batches, and shadow rays from these hits towards one light."""
    yield from _rows("coherent", _coherent_questions, options, bars)


def incoherent(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Glossy bounces off the camera's hits, and random directions from within the mesh's bounding box."""
    yield from _rows("incoherent", _incoherent_questions, options, bars)


Ask = Callable[[Mesh, int, "RayQueries", BenchOptions], list[Question]]


def _rows(group: str, ask: Ask, options: BenchOptions, bars: Bars) -> Iterator[Row]:
    from renderer.rays.queries import RayQueries

    task = bars.task(group, 2 * len(options.subdivisions) * options.repetitions)
    for subdivisions in options.subdivisions:
        mesh = bumpy_sphere(subdivisions)
        ours = RayQueries(mesh.vertices, mesh.faces, threads=1)
        peer = EmbreeMesh(mesh.vertices, mesh.faces) if installed("embreex") else None
        for question in ask(mesh, subdivisions, ours, options):
            row = Row(group, f"{question.name}, {len(mesh.faces):,} triangles", "M rays/s", 0.0, "Embree")
            yield compare(row, question, ours, peer, options.repetitions, task)


def compare(
    row: Row,
    question: Question,
    ours: RayQueries,
    peer: EmbreeMesh | None,
    repetitions: int,
    task: Task,
) -> Row:
    """Fills a row: both sides answer all calls of a question in turns."""
    cases: dict[str, Callable[[], object]] = {"ours": lambda: [_ask(ours, rays) for rays in question.calls]}
    note = NOT_INSTALLED
    if peer is not None:
        cases["peer"] = lambda: [_ask(peer, rays) for rays in question.calls]
        wrong = sum(disagreements(ours, peer, rays) for rays in question.calls)
        note = f"{wrong} of {sum(rays.count for rays in question.calls):,} rays disagree"
    seconds = take_turns(cases, repetitions, task)
    work = sum(rays.count for rays in question.calls) / 1e6
    row = dataclasses.replace(row, note=note)
    return rate_row(row, work, seconds["ours"], seconds.get("peer"), question.target)


def _ask(side: Any, rays: Rays) -> object:
    if rays.t_max is None:
        return side.closest(rays.origin, rays.direction)
    return side.blocked(rays.origin, rays.direction, rays.t_max)


def disagreements(ours: RayQueries, peer: EmbreeMesh, rays: Rays) -> int:
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


def _coherent_questions(mesh: Mesh, subdivisions: int, ours: RayQueries, options: BenchOptions) -> list[Question]:
    calls = framelet_calls(options)
    shadows = [shadow_rays(mesh, ours, rays) for rays in calls]
    return [
        Question("camera rays", calls, CLOSEST_TARGETS.get(subdivisions)),
        Question("shadow rays", shadows, SHADOW_TARGET),
    ]


def _incoherent_questions(mesh: Mesh, subdivisions: int, ours: RayQueries, options: BenchOptions) -> list[Question]:
    generator = np.random.default_rng(0)
    calls = framelet_calls(options)
    bounces = [glossy_bounces(mesh, ours, rays, generator) for rays in calls]
    scattered = [random_rays(mesh, rays.count, generator) for rays in calls]
    return [
        Question("glossy bounces", bounces, INCOHERENT_TARGET),
        Question("random directions", scattered, INCOHERENT_TARGET),
    ]
