"""Nearest hits against a brute-force tracer."""

import numpy as np
import pytest

from renderer.trace import Renderer
from scenes.canonical import (
    Cube,
    Disk,
    ImageTexture,
    Instance,
    Mesh,
    PerspectiveCamera,
    Phong,
    Rectangle,
    Scene,
    Sphere,
)
from tests.oracles.brute_force_tracer import camera_rays, closest_hits
from tests.renderer.builders import batch, colors, grid, image, look_at, place, turning_camera, turning_track

RAMP = ImageTexture(
    image([[(0, 1, 0), (1, 1, 0)], [(0, 0, 0), (1, 0, 0)]]),
    uv_scale=(0.5, 0.5),
    uv_offset=(0.25, 0.25),
    filter="bilinear",
)
"""Yields (u, v, 0) for uv in [0, 1]."""


def _soup(rng: np.random.Generator, count: int) -> np.ndarray:
    return (
        (rng.normal(size=(count, 1, 3)) * 0.7 + rng.normal(size=(count, 3, 3)) * 0.25).reshape(-1, 3).astype(np.float32)
    )


def _scene(label: str) -> Scene:
    """Triangles whose texture tells the face (``label="face"``) or the place within it."""
    rng = np.random.default_rng(3)
    count = 60
    shapes = []
    for _ in range(2):
        vertices, faces = _soup(rng, count), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
        if label == "face":
            uvs = np.repeat(np.stack([(np.arange(count) + 0.5) / count, np.full(count, 0.5)], -1), 3, axis=0)
        else:
            uvs = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (count, 1))
        shapes.append(Mesh(vertices, faces, uvs=uvs.astype(np.float32)))
    placements = [
        (0, place(), None),
        (1, place((0.3, 0.2, -1.0), (0.3, 1.0, 0.2), (0.6, 1.3, 0.9)), None),
        (0, place((-0.5, 0.4, 0.5), (1.0, 0.0, 0.4), (0.5, -0.7, 0.4)), turning_track(1)),
        (1, place((0.5, -0.4, 0.5), (0.0, 0.5, 0.0), (0.4, 0.4, 0.4)), turning_track(2)),
    ]
    instances = []
    for number, (shape, matrix, track) in enumerate(placements):
        if label == "face":
            row = np.zeros((1, count, 3), np.float32)
            row[0, :, 0], row[0, :, 1] = np.arange(count) + 1, number + 1
            texture = ImageTexture(row, filter="nearest")
        else:
            texture = RAMP
        instances.append(Instance(shapes[shape], Phong(texture), matrix, track))
    camera = PerspectiveCamera(look_at((0.5, 1.0, 5.0), (0, 0, 0)), 30.0, track=turning_camera())
    return Scene(camera, tuple(instances), ambient=(1.0, 1.0, 1.0))


@pytest.mark.parametrize("time_s", [-1.0, 0.0, 0.137, 0.7, 9.0])
def test_closest_hits_agree_with_brute_force(time_s: float) -> None:
    faces = _scene("face")
    position = grid(32).astype(np.float32).astype(np.float64)
    expected = closest_hits(faces, *camera_rays(faces, position, time_s), time_s)
    got = colors(faces, position, time_s)
    same = (got[:, 0].astype(int) == expected.face + 1) & (got[:, 1].astype(int) == expected.instance + 1)
    assert (expected.instance >= 0).mean() > 0.2
    assert len(np.unique(expected.instance)) >= 4
    assert (~same).sum() <= 2  # rays through an edge may fall on either side
    within = colors(_scene("place"), position, time_s)[same & (expected.instance >= 0)]
    weights = expected.weights[same & (expected.instance >= 0)]
    np.testing.assert_allclose(within[:, :2], weights[:, 1:], atol=2e-4)


def test_each_ray_sees_the_scene_at_its_own_time() -> None:
    scene = _scene("face")
    position = grid(24).astype(np.float32).astype(np.float64)
    times = np.random.default_rng(0).uniform(-0.5, 1.5, len(position))
    got = colors(scene, position, times)
    wrong = 0
    for ray in range(0, len(position), 3):
        one = closest_hits(scene, *camera_rays(scene, position[ray : ray + 1], times[ray]), times[ray])
        wrong += int(got[ray, 0]) != one.face[0] + 1 or int(got[ray, 1]) != one.instance[0] + 1
    assert wrong <= 1


@pytest.mark.parametrize(
    ("shape", "inside"),
    [
        (Sphere(1.5), lambda o, d: _sphere_t(o / 1.5, d / 1.5)),
        (Disk(1.2), lambda o, d: _plane_t(o, d, lambda x, y: x * x + y * y <= 1.44)),
        (Rectangle(), lambda o, d: _plane_t(o, d, lambda x, y: (np.abs(x) <= 1) & (np.abs(y) <= 1))),
        (Cube(), lambda o, d: _cube_t(o, d)),
    ],
    ids=["sphere", "disk", "rectangle", "cube"],
)
def test_analytic_shapes_have_the_right_outline(shape, inside) -> None:
    matrix = place((0.2, -0.1, 0.3), (0.7, 0.4, 0.2), (0.8, 1.1, -0.6))
    scene = Scene(
        PerspectiveCamera(look_at((0.4, 0.8, 4.0), (0, 0, 0)), 50.0),
        (Instance(shape, Phong(RAMP), matrix),),
        ambient=(1.0, 1.0, 1.0),
    )
    white = Scene(scene.camera, (Instance(shape, Phong(_ONE), matrix),), ambient=(1.0, 1.0, 1.0))
    position = grid(48).astype(np.float32).astype(np.float64)
    origin, direction = camera_rays(scene, position, 0.0)
    inverse = np.linalg.inv(matrix)
    local_o, local_d = origin @ inverse[:3, :3].T + inverse[:3, 3], direction @ inverse[:3, :3].T
    t = inside(local_o, local_d)
    got = colors(white, position)[:, 0] > 0.5
    assert (got != np.isfinite(t)).sum() <= 2
    assert got.sum() > 100
    if isinstance(shape, Rectangle):
        seen = np.isfinite(t) & got
        point = local_o[seen] + t[seen, None] * local_d[seen]
        np.testing.assert_allclose(colors(scene, position)[seen][:, :2], point[:, :2] / 2 + 0.5, atol=1e-4)


_ONE = ImageTexture(image([[(1, 1, 1)]]))


def _sphere_t(o, d):
    a, b, c = (d * d).sum(1), (o * d).sum(1), (o * o).sum(1) - 1
    disc = b * b - a * c
    with np.errstate(invalid="ignore"):
        t = (-b - np.sqrt(disc)) / a
    return np.where((disc >= 0) & (t > 0), t, np.inf)


def _plane_t(o, d, mask):
    t = -o[:, 2] / d[:, 2]
    p = o + t[:, None] * d
    return np.where((t > 0) & mask(p[:, 0], p[:, 1]), t, np.inf)


def _cube_t(o, d):
    a, b = (-1 - o) / d, (1 - o) / d
    near, far = np.minimum(a, b).max(1), np.maximum(a, b).min(1)
    return np.where((near <= far) & (near > 0), near, np.inf)


def test_camera_inside_closed_shapes_sees_them_from_within() -> None:
    for shape in (Sphere(2.0), Cube()):
        scene = Scene(PerspectiveCamera(), (Instance(shape, Phong(_ONE)),), ambient=(1.0, 1.0, 1.0))
        assert (colors(scene, grid(16)) == 1.0).all()


def test_rays_along_the_axes_are_not_lost() -> None:
    scene = Scene(PerspectiveCamera(place((0, 0, 3))), (Instance(Cube(), Phong(_ONE)),), ambient=(1.0, 1.0, 1.0))
    answer = Renderer(scene).trace(batch(np.array([[0.5, 0.5], [0.5, 0.51], [0.49, 0.5]])))
    assert (answer.color == 1.0).all()
