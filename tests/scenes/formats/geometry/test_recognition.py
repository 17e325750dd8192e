"""Meshes that are a rectangle, cube, disk or sphere under a transform, and those that nearly are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes.canonical import ConstantTexture, Cube, Disk, Matte, Mesh, Rectangle, Shape, Sphere
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.geometry.recognition import recognised, recognised_rectangle, shape_of
from scenes.formats.losses import LossReport

SHAPES: tuple[Shape, ...] = (Rectangle(), Cube(), Disk(), Sphere())


def placed(mesh: Mesh, matrix: np.ndarray) -> Mesh:
    """The mesh moved, as an exporter writes it."""
    points = (mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)
    normals = None
    if mesh.normals is not None:
        normals = mesh.normals @ np.linalg.inv(matrix[:3, :3])
        normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    return Mesh(points, mesh.faces, normals, mesh.uvs)


def shuffled(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """The same mesh with its vertices and triangles in another order, triangles starting at another corner."""
    order = rng.permutation(len(mesh.vertices))
    back = np.argsort(order)
    faces = back[mesh.faces][rng.permutation(len(mesh.faces))]
    faces = np.stack([np.roll(face, shift) for face, shift in zip(faces, rng.integers(0, 3, len(faces)), strict=True)])
    parts = [None if part is None else part[order] for part in (mesh.normals, mesh.uvs)]
    return Mesh(mesh.vertices[order], faces.astype(np.int32), *parts)


def matrix_of(rng: np.random.Generator, size: float) -> np.ndarray:
    """Right-handed, sheared, of a condition below about ten."""
    made = np.eye(4)
    while True:
        made[:3, :3] = rng.normal(size=(3, 3))
        spread = np.linalg.svd(made[:3, :3], compute_uv=False)
        if np.linalg.det(made[:3, :3]) > 0.0 and spread[0] < 8.0 * spread[2]:
            break
    made[:3, :3] *= size
    made[:3, 3] = 3.0 * size * rng.normal(size=3)
    return made


def farthest(shape: Shape, found: np.ndarray, mesh: Mesh) -> float:
    """How far the shape's own vertices are from those of the mesh with their texture coordinates."""
    ours = placed(as_mesh(shape), found)
    assert ours.uvs is not None and mesh.uvs is not None
    both = [np.concatenate([one.vertices, np.round(one.uvs, 3), one.normals], axis=1) for one in (ours, mesh)]
    size = np.abs(mesh.vertices).max()
    gaps = [np.abs((both[1] - row) / ([size] * 3 + [1.0] * 5)).max(axis=1).min() for row in both[0]]
    return float(max(gaps))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), size=st.sampled_from([1e-3, 1.0, 500.0]), number=st.integers(0, 3))
def test_a_shape_under_any_transform_is_found(seed: int, size: float, number: int) -> None:
    rng, shape = np.random.default_rng(seed), SHAPES[number]
    matrix = matrix_of(rng, size)
    mesh = placed(as_mesh(shape), matrix)
    found = recognised(shuffled(mesh, rng))
    assert found is not None and type(found[0]) is type(shape)
    assert np.linalg.det(found[1][:3, :3]) > 0.0
    if number < 3:
        assert farthest(found[0], found[1], mesh) < 2e-3
    else:  # the same ellipsoid with the same texture
        ours = placed(as_mesh(found[0]), found[1])
        np.testing.assert_allclose(ours.vertices, mesh.vertices, atol=3e-4 * np.abs(mesh.vertices).max())


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_what_is_found_stays_what_it_is(shape: Shape) -> None:
    """Written as a mesh and found again, any number of times."""
    first = recognised(placed(as_mesh(shape), matrix_of(np.random.default_rng(8), 2.0)))
    assert first is not None
    second = recognised(placed(as_mesh(first[0]), first[1]))
    assert second is not None
    np.testing.assert_allclose(second[1], first[1], atol=2e-5 * np.abs(first[1]).max())


def test_a_cube_of_eight_corners_without_more() -> None:
    mesh = as_mesh(Cube())
    corners, where = np.unique(mesh.vertices, axis=0, return_inverse=True)
    plain = Mesh(corners, where.reshape(-1)[mesh.faces].astype(np.int32))
    found = recognised(placed(plain, matrix_of(np.random.default_rng(3), 1.0)))
    assert found is not None and isinstance(found[0], Cube)
    smooth = Mesh(corners, plain.faces, (corners / np.sqrt(3.0)).astype(np.float32))
    assert recognised(smooth) is None  # shaded as if it were round


def broken(mesh: Mesh, **changes) -> Mesh:
    parts = {name: getattr(mesh, name) for name in ("vertices", "faces", "normals", "uvs")}
    return Mesh(**{**parts, **changes})


def test_near_cubes_are_none() -> None:
    mesh = as_mesh(Cube())
    inside_out, doubled, bent = mesh.faces.copy(), mesh.faces.copy(), mesh.vertices.copy()
    inside_out[3] = inside_out[3, ::-1]
    doubled[1] = doubled[0]
    bent[mesh.vertices.sum(axis=1) == 3.0] *= 1.01
    turned = mesh.uvs.copy()  # type: ignore[union-attr]
    turned[:4] = np.roll(turned[:4], 1, axis=0)
    for other in (
        broken(mesh, faces=inside_out),
        broken(mesh, faces=doubled),
        broken(mesh, vertices=bent),
        broken(mesh, uvs=turned),
        broken(mesh, normals=-mesh.normals),  # type: ignore[operator]
        broken(mesh, faces=mesh.faces[:, ::-1].copy(), normals=-mesh.normals),  # type: ignore[operator]
    ):
        assert recognised(other) is None


def test_near_spheres_are_none() -> None:
    mesh = as_mesh(Sphere())
    rough = mesh.vertices * (1.0 + 0.003 * np.random.default_rng(1).normal(size=(len(mesh.vertices), 1)))
    other_map = mesh.uvs * np.float32([2.0, 1.0])  # type: ignore[operator]
    for other in (
        broken(mesh, vertices=rough.astype(np.float32)),
        broken(mesh, faces=mesh.faces[:3000]),  # open
        broken(mesh, uvs=other_map),
        broken(mesh, normals=None),  # faceted
        broken(mesh, normals=-mesh.normals),  # type: ignore[operator]
        broken(mesh, faces=mesh.faces[:, ::-1].copy(), normals=-mesh.normals),  # type: ignore[operator]
    ):
        assert recognised(other) is None


def test_near_disks_are_none() -> None:
    mesh = as_mesh(Disk())
    for other in (
        broken(mesh, faces=mesh.faces[:50]),
        broken(mesh, uvs=mesh.uvs * np.float32([0.5, 1.0])),  # type: ignore[operator]
        broken(mesh, faces=mesh.faces[:, ::-1].copy(), normals=-mesh.normals),  # type: ignore[operator]
        broken(mesh, uvs=None),
    ):
        assert recognised(other) is None


def test_round_shapes_in_the_place_of_triangles_are_reported() -> None:
    for shape, losses in ((Sphere(), 1), (Disk(), 1), (Cube(), 0), (Rectangle(), 0)):
        report = LossReport()
        found, _ = shape_of(as_mesh(shape), Matte(ConstantTexture((0.5, 0.5, 0.5))), "here", report)
        assert type(found) is type(shape) and len(report.losses) == losses


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_rectangles_are_recognised_under_any_transform(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3, :2], matrix[:3, 3] = rng.normal(size=(3, 2)), rng.normal(size=3)
    normal = np.cross(matrix[:3, 0], matrix[:3, 1])
    matrix[:3, 2] = normal / np.linalg.norm(normal)
    plain = as_mesh(Rectangle())
    points = (plain.vertices @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)
    normals = np.tile(matrix[:3, 2], (4, 1)).astype(np.float32)
    found = recognised_rectangle(Mesh(points, plain.faces, normals, plain.uvs))
    assert found is not None
    np.testing.assert_allclose(found, matrix, atol=1e-4 * np.abs(matrix).max() + 1e-5)
    bent = points.copy()
    bent[2] += 0.1 * np.abs(points).max()
    assert recognised_rectangle(Mesh(bent, plain.faces, normals, plain.uvs)) is None
    assert recognised_rectangle(Mesh(points, plain.faces, -normals, plain.uvs)) is None
