"""Procedural meshes are closed, look outwards, and are cut exactly where asked."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.driving.cutting import carve, cut
from scenes.driving.meshing import (
    SurfaceMesh,
    box,
    boxes,
    ellipsoid,
    extrude,
    flat,
    from_faces,
    grid,
    grids,
    join,
    lathe,
    mirrored_y,
    moved,
    smooth_normals,
    transformed,
    tube,
    unit,
)
from tests.scenes.builders import areas, corners, face_normals, open_edges, volume

OUTLINE = np.array([(0.0, 0.0), (2.0, -0.3), (2.4, 1.0), (1.0, 1.8), (-0.2, 1.0)])
OUTLINE_AREA = 0.5 * abs(
    sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(OUTLINE, np.roll(OUTLINE, -1, axis=0), strict=True))
)
CYLINDER = np.array([(0.0, -1.0), (0.5, -1.0), (0.5, 2.0), (0.0, 2.0)])

CLOSED = {
    "box": (box((-1.0, 0.5, 2.0), (1.0, 1.5, 5.0)), 6.0),
    "ellipsoid": (ellipsoid((1.0, -2.0, 3.0), (1.0, 2.0, 0.5), 60, 90), 4.0 / 3.0 * np.pi),
    "extrusion": (extrude(OUTLINE, -0.5, 1.5), 2.0 * OUTLINE_AREA),
    "cylinder": (lathe(CYLINDER, 200), 0.75 * np.pi),
    "cone": (tube((1.0, 1.0, 1.0), (1.0, 1.0, 3.0), 0.6, 0.3, 200), np.pi * 2.0 / 3.0 * (0.36 + 0.18 + 0.09)),
}


def wavy(rows: int = 13, columns: int = 9) -> SurfaceMesh:
    """An open, curved sheet over the unit square."""
    u, v = np.meshgrid(np.linspace(0.0, 1.0, rows), np.linspace(0.0, 1.0, columns), indexing="ij")
    return grid(np.stack([u, v, 0.2 * np.sin(5.0 * u) * np.cos(4.0 * v)], axis=-1))


def level(size: int = 8) -> SurfaceMesh:
    """The unit square, flat, facing up."""
    u, v = np.meshgrid(*[np.linspace(0.0, 1.0, size)] * 2, indexing="ij")
    return grid(np.stack([u, v, np.zeros_like(u)], axis=-1))


# --- shapes ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CLOSED)
def test_shapes_are_closed(name: str) -> None:
    shape, expected = CLOSED[name]
    assert open_edges(shape) == set()
    assert volume(shape) == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize("name", CLOSED)
def test_normals_point_outwards(name: str) -> None:
    """Away from a point within, for these are convex; those of the faces and those that are shaded."""
    shape, _ = CLOSED[name]
    middle = 0.5 * (shape.vertices.min(axis=0) + shape.vertices.max(axis=0))
    a, b, c = corners(shape)
    proper = areas(shape) > 1e-9
    assert (np.einsum("ij,ij->i", face_normals(shape), (a + b + c) / 3.0 - middle)[proper] > 0.0).all()
    used = np.unique(shape.faces[proper])
    assert (np.einsum("ij,ij->i", shape.normals, shape.vertices - middle)[used] > 0.0).all()
    assert np.linalg.norm(shape.normals, axis=1) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("name", CLOSED)
def test_the_canonical_mesh_has_no_empty_triangles(name: str) -> None:
    shape, _ = CLOSED[name]
    mesh = shape.mesh("a name")
    assert areas(mesh).min() > 0.0 and mesh.source == "a name"
    assert areas(mesh).sum() == pytest.approx(areas(shape).sum(), rel=1e-5)
    assert sorted(set(mesh.faces.ravel().tolist())) == list(range(len(mesh.vertices)))
    assert mesh.normals is not None and mesh.uvs is not None
    assert (mesh.vertices.dtype, mesh.faces.dtype, mesh.normals.dtype) == (np.float32, np.int32, np.float32)


def test_empty_triangles_at_the_poles_are_dropped() -> None:
    ball = ellipsoid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 6, 10)
    assert len(ball.faces) == 6 * 10 * 2 and len(ball.mesh("").faces) == 5 * 10 * 2


def test_a_grid_faces_along_the_product_of_its_directions() -> None:
    sheet = level(4)
    assert sheet.normals == pytest.approx(np.tile([0.0, 0.0, 1.0], (16, 1)))
    assert face_normals(sheet)[:, 2].min() > 0.0
    assert sheet.uvs == pytest.approx(sheet.vertices[:, :2])
    assert len(open_edges(sheet)) == 4 * 3


def test_corners_of_a_lathe_stay_sharp_and_gentle_bends_do_not() -> None:
    barrel = lathe(CYLINDER, 24)
    axial = np.abs(barrel.normals[:, 1])
    assert ((axial < 1e-9) | (axial > 1.0 - 1e-9)).all() and (axial < 1e-9).any() and (axial > 0.5).any()
    bent = lathe(np.array([(1.0, 0.0), (1.0, 1.0), (0.9, 2.0)]), 24)
    middle = bent.normals[np.isclose(bent.vertices[:, 1], 1.0)]
    assert len(np.unique(np.round(middle[:, 1], 6))) == 1 and 0.01 < middle[0, 1] < 0.09


def test_box_has_flat_faces_and_uv_in_metres() -> None:
    wall = box((0.0, 0.0, 0.0), (4.0, 2.0, 3.0))
    assert np.abs(wall.normals).max(axis=1) == pytest.approx(1.0)
    uprights = np.abs(wall.normals[:, 2]) < 0.5
    assert wall.uvs[uprights, 1] == pytest.approx(wall.vertices[uprights, 2])


def bits(surface: SurfaceMesh) -> list[bytes]:
    """Everything of a surface, to the last bit and the sign of zeros."""
    return [array.tobytes() for array in (surface.vertices, surface.faces, surface.normals, surface.uvs)]


def test_many_grids_at_once_are_the_same_as_one_by_one() -> None:
    """Also where nets share an edge: each keeps normals of its own."""
    nets = np.random.default_rng(1).standard_normal((5, 4, 3, 3))
    nets[1, 0], nets[3] = nets[0, -1], nets[2]
    found = grids(nets)
    assert bits(found) == bits(join([grid(net) for net in nets]))
    shared = [found.normals.reshape(5, 4, 3, 3)[1, 0], found.normals.reshape(5, 4, 3, 3)[0, -1]]
    assert not np.allclose(*shared)


def test_many_boxes_at_once_are_the_same_as_one_by_one() -> None:
    """A side of a box is the net of its corners, walked so that it faces outwards."""
    low = np.random.default_rng(2).standard_normal((6, 3))
    spans = [(tuple(corner), tuple(corner + size)) for corner, size in zip(low, np.abs(low) + 0.1, strict=True)]
    spans[3] = (spans[2][0], spans[2][1])
    found = boxes(spans)
    assert bits(found) == bits(join([box(*span) for span in spans]))
    assert volume(found) == pytest.approx(sum(np.prod(np.subtract(*span[::-1])) for span in spans))
    assert np.allclose(np.repeat(unit(face_normals(found)), 3, axis=0), found.normals[found.faces.reshape(-1)])


def test_flat_separates_triangles() -> None:
    ball = flat(ellipsoid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 6, 8))
    proper = areas(ball) > 1e-9
    expected = np.repeat(face_normals(ball)[proper] / (2.0 * areas(ball)[proper, None]), 3, axis=0)
    assert ball.normals[ball.faces[proper].ravel()] == pytest.approx(expected)


@pytest.mark.parametrize("end", [(3.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.0, 0.0, 1.0), (-1.0, 2.0, 0.5)])
def test_tube_runs_between_its_ends(end: tuple[float, float, float]) -> None:
    start = np.array([0.3, -0.2, 1.0])
    bar = tube(start.tolist(), (start + end).tolist(), 0.2, 0.1, 12)
    length = np.linalg.norm(end)
    along = (bar.vertices - start) @ (np.array(end) / length)
    away = np.linalg.norm(bar.vertices - start - along[:, None] * (np.array(end) / length), axis=1)
    assert open_edges(bar) == set() and volume(bar) > 0.0
    assert sorted({round(value, 6) for value in along}) == pytest.approx([0.0, length])
    assert away[along < 0.5 * length].max() == pytest.approx(0.2)
    assert away[along > 0.5 * length].max() == pytest.approx(0.1)


@pytest.mark.parametrize("weld", [1e-6, 1e-4])
def test_smooth_normals_of_a_sphere(weld: float) -> None:
    """Within two degrees of the radius, at the seam and at the poles too."""
    ball = ellipsoid((0.0, 0.0, 0.0), (2.0, 2.0, 2.0), 24, 36)
    found = smooth_normals(ball.vertices, ball.faces, weld)
    radial = ball.vertices / np.linalg.norm(ball.vertices, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", found, radial).min() > np.cos(np.radians(2.0))
    alone = smooth_normals(flat(ball).vertices, flat(ball).faces, weld)
    assert alone == pytest.approx(found[ball.faces.ravel()], abs=1e-9), "coincident vertices share their normal"


def test_ellipsoid_normals_are_those_of_the_surface() -> None:
    radii = np.array([1.0, 2.0, 0.5])
    egg = ellipsoid((1.0, 1.0, 1.0), radii.tolist(), 30, 40)
    gradient = (egg.vertices - 1.0) / radii**2
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", egg.normals, gradient).min() > np.cos(np.radians(2.0))


def test_moves_and_reflections_keep_the_outside_outside() -> None:
    shape = moved(extrude(OUTLINE, 0.0, 1.0), (0.0, 3.0, 0.0))
    image = mirrored_y(shape)
    assert volume(image) == pytest.approx(volume(shape)) and volume(shape) > 0.0
    assert image.vertices == pytest.approx(shape.vertices * [1.0, -1.0, 1.0])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = transformed(shape, turn, (1.0, 0.0, 0.0))
    assert turned.vertices[:, 1] == pytest.approx(shape.vertices[:, 0])
    for one in (image, turned):
        facing = np.einsum("ij,ij->i", face_normals(one), one.normals[one.faces[:, 0]])
        assert facing.min() > 0.0


def test_join_keeps_every_part() -> None:
    first, second = box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), moved(extrude(OUTLINE, 0.0, 1.0), (9.0, 0.0, 0.0))
    both = join([first, second])
    assert volume(both) == pytest.approx(1.0 + OUTLINE_AREA) and open_edges(both) == set()
    assert len(both.faces) == len(first.faces) + len(second.faces)


def test_compact_drops_unused_vertices_only() -> None:
    sheet = level(4)
    few = SurfaceMesh(sheet.vertices, sheet.faces[[3, 7]], sheet.normals, sheet.uvs).compact()
    assert len(few.vertices) == len(np.unique(sheet.faces[[3, 7]])) < len(sheet.vertices)
    assert few.vertices[few.faces] == pytest.approx(sheet.vertices[sheet.faces[[3, 7]]])
    assert few.uvs[few.faces] == pytest.approx(sheet.uvs[sheet.faces[[3, 7]]])
    assert few.normals.shape == few.vertices.shape


# --- cutting ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("normal", [(1.0, 0.0, 0.0), (0.3, 1.0, 0.0), (-0.5, 0.7, 0.4)])
@pytest.mark.parametrize("shape", [wavy(), CLOSED["extrusion"][0], ellipsoid((0.5, 0.5, 0.0), (0.6, 0.5, 0.4))])
def test_a_plane_cuts_exactly(shape: SurfaceMesh, normal: tuple[float, float, float]) -> None:
    distance = (shape.vertices - [0.47, 0.52, 0.0]) @ np.array(normal)
    below, above = cut(shape, distance)
    for part, sign in ((below, -1.0), (above, 1.0)):
        assert len(part.faces) > 0
        side = sign * ((part.vertices - [0.47, 0.52, 0.0]) @ np.array(normal))
        assert side.min() > -2e-9 and side.max() > 0.05
        assert np.linalg.norm(part.normals, axis=1) == pytest.approx(1.0, abs=1e-9)
    assert areas(below).sum() + areas(above).sum() == pytest.approx(areas(shape).sum(), rel=1e-9)
    assert min(areas(below).sum(), areas(above).sum()) > 0.05 * areas(shape).sum()


@pytest.mark.parametrize("seed", range(6))
def test_any_function_cuts_without_gaps(seed: int) -> None:
    """The parts of a closed shape meet along the same edges, run through the other way, and keep its area."""
    shape = extrude(OUTLINE, 0.0, 1.0) if seed % 2 else ellipsoid((0.0, 0.0, 0.0), (1.0, 2.0, 0.7))
    random = np.random.default_rng(seed)
    waves = random.normal(size=(3, 3)) * 2.0
    value = np.sin(shape.vertices @ waves + random.uniform(0.0, 6.0, 3)).sum(axis=1)
    below, above = cut(shape, value)
    edges, others = open_edges(below, 1e-9), open_edges(above, 1e-9)
    assert len(edges) > 4 and edges == {(b, a) for a, b in others}
    assert areas(below).sum() + areas(above).sum() == pytest.approx(areas(shape).sum(), rel=1e-9)
    assert volume(join([below, above])) == pytest.approx(volume(shape), rel=1e-9)


def test_the_cut_follows_the_linear_zero_line() -> None:
    """Coordinates and texture coordinates of new vertices are interpolated alike."""
    sheet = level(6)
    value = np.random.default_rng(2).normal(size=len(sheet.vertices))
    below, above = cut(sheet, value)
    for part in (below, above):
        assert part.uvs == pytest.approx(part.vertices[:, :2])
        assert part.normals == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(part.vertices), 1)))
        assert face_normals(part)[:, 2].min() > 0.0, "no triangle is turned over"
    one = from_faces(np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]), np.array([[0, 1, 2]]))
    tip, rest = cut(one, np.array([-1.0, 3.0, 1.0]))
    assert sorted(map(tuple, np.round(tip.vertices, 9).tolist())) == [(0, 0, 0), (0, 0.5, 0), (0.25, 0, 0)]
    assert areas(tip).sum() == pytest.approx(0.0625) and areas(rest).sum() == pytest.approx(0.4375)


def test_a_cut_beside_the_surface_takes_all_or_nothing() -> None:
    sheet = wavy()
    for sign in (1.0, -1.0):
        below, above = cut(sheet, np.full(len(sheet.vertices), sign))
        whole, none = (above, below) if sign > 0.0 else (below, above)
        assert len(none.faces) == 0 and len(none.vertices) == 0
        assert whole.vertices[whole.faces] == pytest.approx(sheet.vertices[sheet.faces])


def test_a_cut_through_vertices_leaves_no_slivers() -> None:
    sheet = level(5)
    below, above = cut(sheet, sheet.vertices[:, 0] - 0.5)
    assert areas(below).sum() == pytest.approx(0.5, abs=1e-6)
    assert areas(above.mesh("")).min() > 1e-3 and areas(below.mesh("")).min() > 1e-3


def test_carving_cuts_an_intersection_with_sharp_corners() -> None:
    low, high = np.array([0.213, 0.337]), np.array([0.781, 0.642])
    piece, rest = carve(
        level(),
        lambda p: low[0] - p[:, 0],
        lambda p: p[:, 0] - high[0],
        lambda p: low[1] - p[:, 1],
        lambda p: p[:, 1] - high[1],
    )
    area = float(np.prod(high - low))
    assert areas(piece).sum() == pytest.approx(area, abs=1e-9)
    assert areas(rest).sum() == pytest.approx(1.0 - area, abs=1e-9)
    assert piece.vertices[:, :2].min(axis=0) == pytest.approx(low) and piece.vertices[:, :2].max(axis=0) == (
        pytest.approx(high)
    )
    for corner in ((low[0], low[1]), (low[0], high[1]), (high[0], low[1]), (high[0], high[1])):
        assert np.linalg.norm(piece.vertices[:, :2] - corner, axis=1).min() < 1e-9
    a, b, c = (p[:, :2] for p in corners(rest))
    inside = np.abs((a + b + c) / 3.0 - 0.5 * (low + high)) < 0.5 * (high - low)
    assert not inside.all(axis=1).any(), "nothing is left in the opening"
