"""Rays that are compared with Embree's: their properties, and the same answers from both sides."""

from pathlib import Path

import numpy as np
import pytest

from analysis.bench import embree as embree_peer
from analysis.bench import rays as bench_rays
from analysis.bench.embree import MODES, EmbreeMesh, Mode, missing
from analysis.bench.machine import uses_avx512
from analysis.bench.options import BenchOptions
from analysis.bench.rays import (
    Rays,
    coherent,
    compare,
    disagreements,
    framelet_calls,
    glossy_bounces,
    incoherent,
    random_rays,
    seen,
    shadow_rays,
)
from analysis.bench.rows import NOT_INSTALLED, Row
from analysis.bench.scenes import LIGHT, bumpy_sphere
from analysis.command.progress import Bars, Task
from renderer.rays.queries import RayQueries

SMALL = BenchOptions(Path("unused"), resolution_px=256, batch_size=128, subdivisions=(4,), repetitions=7)
MESH = bumpy_sphere(4)


@pytest.fixture(scope="module")
def ours() -> RayQueries:
    return RayQueries(MESH.vertices, MESH.faces, threads=1)


def all_kinds(ours: RayQueries) -> dict[str, list[Rays]]:
    generator = np.random.default_rng(1)
    calls = framelet_calls(SMALL)
    return {
        "camera": calls,
        "shadow": [shadow_rays(MESH, ours, rays) for rays in calls],
        "glossy": [glossy_bounces(MESH, ours, rays, generator) for rays in calls],
        "random": [random_rays(MESH, 4096, generator) for _ in range(16)],
    }


def test_both_sides_agree_on_nearly_every_ray(ours: RayQueries) -> None:
    embree = pytest.importorskip("embreex") and bench_rays.EmbreexMesh(MESH.vertices, MESH.faces)
    for kind, calls in all_kinds(ours).items():
        count = sum(rays.count for rays in calls)
        wrong = sum(disagreements(ours, embree, rays) for rays in calls)
        assert wrong < 1e-4 * count, (kind, wrong, count)
        assert count > 40_000, kind


def test_disagreements_are_counted(ours: RayQueries) -> None:
    """Against another mesh there are many differences, so the agreement above is not that of a blind comparison."""
    pytest.importorskip("embreex")
    other = bench_rays.EmbreexMesh(MESH.vertices * np.float32(0.9), MESH.faces)
    for kind, calls in all_kinds(ours).items():
        assert disagreements(ours, other, calls[0]) > 0.005 * calls[0].count, kind


def test_shadow_rays_start_above_what_is_seen_and_end_at_the_light(ours: RayQueries) -> None:
    rays = framelet_calls(SMALL)[0]
    shadow = shadow_rays(MESH, ours, rays)
    point, normal, hit = seen(MESH, ours, rays)
    assert shadow.t_max is not None and np.all(shadow.t_max < 1.0)
    np.testing.assert_allclose(shadow.origin + shadow.direction, np.broadcast_to(LIGHT, shadow.origin.shape), atol=1e-5)
    assert len(point) == hit.sum() > shadow.count > 0
    assert (np.einsum("ij,ij->i", normal, rays.direction[hit]) < 0.0).all()


def test_bounces_leave_the_surface_near_the_mirror_direction(ours: RayQueries) -> None:
    rays = framelet_calls(SMALL)[0]
    bounces = glossy_bounces(MESH, ours, rays, np.random.default_rng(1))
    _, normal, hit = seen(MESH, ours, rays)
    assert bounces.count == hit.sum()
    assert (np.einsum("ij,ij->i", bounces.direction, normal) >= -1e-6).all()
    towards = rays.direction[hit]
    mirrored = towards - 2.0 * np.einsum("ij,ij->i", towards, normal)[:, None] * normal
    cosine = np.einsum("ij,ij->i", mirrored, bounces.direction)
    assert 0.9 < np.median(cosine) < 0.999


def test_random_rays_are_as_often_up_as_down() -> None:
    rays = random_rays(MESH, 20_000, np.random.default_rng(1))
    assert np.abs(rays.direction.mean(axis=0)).max() < 0.02
    np.testing.assert_allclose(np.linalg.norm(rays.direction, axis=1), 1.0, atol=1e-5)
    assert (rays.origin >= MESH.vertices.min(axis=0)).all() and (rays.origin <= MESH.vertices.max(axis=0)).all()


def test_rows_of_both_groups() -> None:
    rows = [*coherent(SMALL, Bars()), *incoherent(SMALL, Bars())]
    assert [row.name for row in rows] == [
        f"{kind}, 5,120 triangles" for kind in ("camera rays", "shadow rays", "glossy bounces", "random directions")
    ]
    glossy = 1.1 if uses_avx512("native") else 1.0
    assert [row.target for row in rows] == [2.0, 1.5, glossy, 1.0]
    assert all(row.ours > 0.0 and row.repetitions == 7 for row in rows)
    if not missing():
        for row in rows:
            others = [float(part.split()[-1]) for part in row.note.split("; ")[1:]]
            assert len(others) == 5, "embreex and the other modes of Embree"
            assert row.peer is not None and row.peer >= max(others) * (1.0 - 1e-2), "the fastest counts"


def test_without_embree_the_row_says_so(ours: RayQueries) -> None:
    question = bench_rays.Question("camera rays", framelet_calls(SMALL)[:1])
    row = compare(Row("coherent", "a", "M rays/s", 0.0, target=3.0), question, ours, None, None, 7, Task())
    assert row.note == NOT_INSTALLED and row.peer is None and row.met is None and row.ours > 0.0


@pytest.mark.parametrize("isa", ["native", "avx2"])
@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_every_mode_of_embree_finds_the_same_hits(ours: RayQueries, mode: Mode, isa: str) -> None:
    if missing():
        pytest.skip(missing())
    embree = EmbreeMesh(MESH.vertices, MESH.faces, isa)
    for kind, calls in all_kinds(ours).items():
        rays = Rays(
            calls[0].origin[:-3], calls[0].direction[:-3], None if calls[0].t_max is None else calls[0].t_max[:-3]
        )
        if rays.t_max is not None:
            theirs = embree.blocked(mode, rays.origin, rays.direction, rays.t_max) >= 0
            wrong = theirs != ours.blocked(rays.origin, rays.direction, rays.t_max)
        else:
            face, distance = embree.closest(mode, rays.origin, rays.direction)
            mine = ours.closest(rays.origin, rays.direction)
            near = np.isclose(distance, mine.t, rtol=1e-4, atol=1e-4)
            wrong = np.where(face < 0, mine.face >= 0, ~near)
        assert wrong.mean() < 1e-3, kind


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embree_peer.shutil, "which", lambda name: None)
    assert missing() in ("embreex is not installed", "there is no C compiler, cc")
