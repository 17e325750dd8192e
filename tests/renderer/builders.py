"""Small scenes and batches for the renderer's tests."""

from __future__ import annotations

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    Cube,
    DirectionalLight,
    EnvironmentLight,
    ImageTexture,
    Instance,
    Integrator,
    Mesh,
    PerspectiveCamera,
    Phong,
    Rectangle,
    RigidTrack,
    Scene,
    Sphere,
)
from tsar.types import FrameletBatch

WHITE = ConstantTexture((1.0, 1.0, 1.0))


def place(translation=(0.0, 0.0, 0.0), axis_angle=(0.0, 0.0, 0.0), scale=(1.0, 1.0, 1.0)) -> np.ndarray:
    """``(4, 4)`` transform: scale, then rotate (vector of radians), then translate."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(axis_angle).as_matrix() @ np.diag(scale)
    matrix[:3, 3] = translation
    return matrix


def look_at(eye, target, up=(0.0, 1.0, 0.0)) -> np.ndarray:
    """Camera-to-world transform at ``eye`` that looks at ``target``."""
    back = np.subtract(eye, target) / np.linalg.norm(np.subtract(eye, target))
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(back, right), back], axis=1)
    matrix[:3, 3] = eye
    return matrix


def image(rows) -> np.ndarray:
    """A float32 image from nested lists."""
    return np.ascontiguousarray(np.asarray(rows, np.float32))


def grid(side: int) -> np.ndarray:
    """Pixel centres ``(side², 2)`` of a square image, row by row."""
    step = (np.arange(side) + 0.5) / side
    x, y = np.meshgrid(step, step)
    return np.stack([x, y], axis=-1).reshape(-1, 2)


def batch(position: np.ndarray, time_s=0.0, samples: int = 1) -> FrameletBatch:
    """A batch of flat positions ``(k, 2)``, ``samples`` to a framelet, at one time or one time each."""
    where = torch.as_tensor(np.asarray(position), dtype=torch.float32).reshape(-1, samples, 2)
    times = torch.as_tensor(np.broadcast_to(time_s, where.shape[:2]).copy() if np.ndim(time_s) == 0 else time_s)
    times = times.to(torch.float64).reshape(-1, samples)
    zeros = torch.zeros(where.shape[0], dtype=torch.int64)
    return FrameletBatch(zeros, zeros, where, times)


def colors(scene: Scene, position: np.ndarray, time_s=0.0, **options) -> np.ndarray:
    """Colours ``(k, 3)`` that a renderer gives at image positions."""
    return Renderer(scene, **options).trace(batch(position, time_s)).color.reshape(-1, 3).numpy()


def center_color(scene: Scene, **options) -> np.ndarray:
    """Colour ``(3,)`` at the middle of the image."""
    return colors(scene, np.array([[0.5, 0.5]]), **options)[0]


def sphere_mesh(rings: int = 16) -> Mesh:
    """A unit sphere of ``4 rings²`` triangles or so, with smooth normals."""
    theta = np.linspace(0.0, np.pi, rings + 1)
    phi = np.linspace(0.0, 2 * np.pi, 2 * rings + 1)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    vertices = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1).reshape(-1, 3)
    uvs = np.stack([p / (2 * np.pi), 1 - t / np.pi], -1).reshape(-1, 2)
    row = 2 * rings + 1
    faces = []
    for i in range(rings):
        for j in range(2 * rings):
            a, b, c, d = i * row + j, (i + 1) * row + j, (i + 1) * row + j + 1, i * row + j + 1
            if i < rings - 1:
                faces.append((a, b, c))
            if i > 0:
                faces.append((a, c, d))
    smooth = vertices.astype(np.float32)
    return Mesh(smooth, np.array(faces, np.int32), smooth, uvs.astype(np.float32), "sphere")


def turning_track(seed: int = 0, keys: int = 5) -> RigidTrack:
    """A track that moves and turns, with keys from time -0.2 every 0.3 s."""
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(np.cumsum(rng.normal(size=(keys, 3)) * 0.5, axis=0)).as_quat()
    for key in range(1, keys):
        if turns[key] @ turns[key - 1] < 0:
            turns[key] = -turns[key]
    return RigidTrack(-0.2, 0.3, np.cumsum(rng.normal(size=(keys, 3)) * 0.2, axis=0), turns)


def driving_scene() -> Scene:
    """Ground, a smooth mirroring mesh and a moving one under a sun and a sky: a bit of everything."""
    rng = np.random.default_rng(5)
    road = ImageTexture(rng.random((64, 64, 3), dtype=np.float32), uv_scale=(30.0, 30.0))
    sky = np.linspace(1.0, 0.2, 16, dtype=np.float32)[:, None, None] * np.array([0.5, 0.7, 1.0], np.float32)
    mesh = sphere_mesh()
    paint = Phong(ConstantTexture((0.6, 0.1, 0.1)), (0.3, 0.3, 0.3), 40.0, fresnel_min=0.1, fresnel_max=0.9)
    return Scene(
        camera=PerspectiveCamera(look_at((0.0, 1.5, 5.0), (0.0, 0.8, 0.0)), 50.0, track=turning_camera()),
        instances=(
            Instance(Rectangle(), Phong(road), place(axis_angle=(-np.pi / 2, 0, 0), scale=(50, 50, 50)), name="road"),
            Instance(mesh, paint, place((-0.8, 1.0, 0.0)), name="still"),
            Instance(mesh, paint, place((1.0, 0.9, 0.3), scale=(0.5, 0.8, -0.6)), turning_track(), name="moving"),
            Instance(Sphere(0.3), Phong(WHITE, ambient=0.5), place((0.0, 0.3, 1.5)), name="ball"),
        ),
        lights=(DirectionalLight((-1.0, -2.0, -1.0), (2.0, 1.9, 1.7)),),
        background=EnvironmentLight(np.ascontiguousarray(np.broadcast_to(sky, (16, 32, 3)))),
        integrator=Integrator(depth=3),
        ambient=(0.3, 0.3, 0.35),
        duration_s=1.0,
    )


def turning_camera() -> RigidTrack:
    """A camera that sways a little."""
    turns = Rotation.from_rotvec([[0, 0, 0], [0, 0.05, 0], [0, 0.02, 0.02]]).as_quat()
    return RigidTrack(0.0, 0.5, np.array([[0, 0, 0], [0.1, 0, 0], [0.2, 0.05, 0]], np.float64), turns)


def _patch(rows: np.ndarray, columns: np.ndarray, surface, shape: tuple[int, int], source: str) -> Mesh:
    """A grid of triangles over ranges of two parameters; ``surface`` maps them to points ``(..., 3)``."""
    u, v = np.meshgrid(np.linspace(*rows, shape[0] + 1), np.linspace(*columns, shape[1] + 1), indexing="ij")
    points, step = surface(u, v), 1e-4
    normals = np.cross(surface(u + step, v) - points, surface(u, v + step) - points)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    flat = [array.reshape(-1, array.shape[-1]).astype(np.float32) for array in (points, normals)]
    return Mesh(
        flat[0], faces.astype(np.int32), flat[1], np.stack([u, v], -1).reshape(-1, 2).astype(np.float32), source
    )


def _hull(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A rounded box, 4.4 long along z, as ``u`` runs along it and ``v`` around it."""
    around = np.stack([-np.cos(v), np.sin(v)], -1)
    ring = np.sign(around) * np.abs(around) ** 0.6 * np.array([0.9, 0.55]) * (np.sin(u)[..., None] ** 0.3)
    cabin = 0.45 * np.exp(-((np.cos(u) / 0.45) ** 2)) * np.maximum(ring[..., 1], 0.0) / 0.55
    return np.stack([ring[..., 0], ring[..., 1] + cabin, -2.2 * np.cos(u)], -1)


def _tyre(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A torus about the x axis."""
    radius = 0.24 + 0.1 * np.cos(v)
    return np.stack([0.11 * np.sin(v), radius * np.cos(u), radius * np.sin(u)], -1)


def _drive(offset: tuple[float, float, float], turns: float) -> RigidTrack:
    """Motion along z at 15 units a second for 2 s; a part at ``offset`` turns about x with ``turns`` a second."""
    time = np.linspace(-1.0, 1.0, 241)
    at = np.asarray(offset) + np.stack([0.3 * np.sin(time), 0.01 * np.sin(9 * time), 15.0 * time], -1)
    half = np.pi * turns * time
    zero = np.zeros_like(half)
    return RigidTrack(-1.0, time[1] - time[0], at, np.stack([np.sin(half), zero, zero, np.cos(half)], -1))


def vehicle_scene() -> Scene:
    """A driving scene as the built-in ones are, but simpler.

    A textured ground, 15 boxes beside the road, and a painted, mirroring body of 15,000 triangles in 12 parts on one
    track, on four wheels of 3,000 triangles on tracks of their own, under a sun and a sky.
    """
    rng = np.random.default_rng(7)
    road = Phong(ImageTexture(rng.random((512, 512, 3), dtype=np.float32), uv_scale=(60.0, 60.0)))
    paint = Phong(ConstantTexture((0.6, 0.05, 0.05)), (0.4, 0.4, 0.4), 60.0, fresnel_min=0.05, fresnel_max=0.9)
    rubber = Phong(ConstantTexture((0.03, 0.03, 0.03)), (0.05, 0.05, 0.05), 8.0)
    wall = Phong(ImageTexture(rng.random((128, 128, 3), dtype=np.float32), uv_scale=(4.0, 4.0)))
    parts = [
        Instance(
            _patch(
                (0.01 + 1.04 * i, 0.01 + 1.04 * (i + 1)), (np.pi / 2 * j, np.pi / 2 * (j + 1)), _hull, (25, 25), "hull"
            ),
            paint,
            place((0.0, 0.75, 0.0)),
            _BODY,
            name=f"body {i} {j}",
        )
        for i in range(3)
        for j in range(4)
    ]
    tyre = _patch((0.0, 2 * np.pi), (0.0, 2 * np.pi), _tyre, (50, 30), "tyre")
    wheels = [
        Instance(tyre, rubber, track=_drive((x, 0.34, z), 7.0), name=f"wheel {x} {z}")
        for x in (-0.8, 0.8)
        for z in (-1.35, 1.35)
    ]
    houses = [
        Instance(Cube(), wall, place((side * (8.0 + row % 3), 3.0, 9.0 * row - 30.0), scale=(2.5, 3.0 + row % 2, 3.5)))
        for row in range(8)
        for side in ((-1.0, 1.0) if row < 7 else (1.0,))
    ]
    sky = rng.random((256, 512, 3), dtype=np.float32) * np.linspace(1.0, 0.3, 256, dtype=np.float32)[:, None, None]
    ground = Instance(Rectangle(), road, place(axis_angle=(-np.pi / 2, 0, 0), scale=(100, 100, 100)), name="road")
    return Scene(
        PerspectiveCamera(look_at((4.2, 1.7, 6.0), (0.0, 1.0, 0.0)), 45.0),
        (ground, *houses, *parts, *wheels),
        (DirectionalLight((-1.0, -2.0, -1.0), (2.0, 1.9, 1.7)),),
        background=EnvironmentLight(sky),
        integrator=Integrator(depth=3),
        ambient=(0.3, 0.3, 0.35),
        duration_s=1.0,
    )


_BODY = _drive((0.0, 0.0, 0.0), 0.0)
