"""A slow, obvious ray tracer in float64 NumPy: every ray against every triangle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from scenes.canonical import Mesh, RigidTrack, Scene


@dataclass
class Hits:
    """Nearest hits of rays; ``instance`` is -1 for a miss, ``weights`` are barycentric."""

    t: np.ndarray
    instance: np.ndarray
    face: np.ndarray
    weights: np.ndarray


def track_matrix(track: RigidTrack | None, time_s: float) -> np.ndarray:
    """``(4, 4)`` pose of a track at a time, with SciPy's slerp."""
    matrix = np.eye(4)
    if track is None:
        return matrix
    keys = track.start_s + track.interval_s * np.arange(len(track.translation))
    at = float(np.clip(time_s, keys[0], keys[-1]))
    matrix[:3, 3] = [np.interp(at, keys, track.translation[:, axis]) for axis in range(3)]
    if len(keys) == 1:
        matrix[:3, :3] = Rotation.from_quat(track.rotation[0]).as_matrix()
    else:
        matrix[:3, :3] = Slerp(keys, Rotation.from_quat(track.rotation))(at).as_matrix()
    return matrix


def camera_rays(
    scene: Scene, position: np.ndarray, time_s: float, aspect: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions ``(k, 3)`` for image positions ``(k, 2)`` from the top left corner."""
    camera = scene.camera
    half = np.tan(np.radians(camera.fov_deg) / 2)
    half_x, half_y = (half * aspect, half) if aspect >= 1 else (half, half / aspect)
    local = np.stack(
        [(2 * position[:, 0] - 1) * half_x, (1 - 2 * position[:, 1]) * half_y, -np.ones(len(position))], axis=1
    )
    matrix = track_matrix(camera.track, time_s) @ camera.to_world
    direction = local @ matrix[:3, :3].T
    return np.broadcast_to(matrix[:3, 3], local.shape), direction / np.linalg.norm(direction, axis=1, keepdims=True)


def triangles_in_world(scene: Scene, time_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners ``(f, 3, 3)`` of all meshes' faces at a time, and the instance and face number of each."""
    corners, instances, faces = [], [], []
    for number, instance in enumerate(scene.instances):
        assert isinstance(instance.shape, Mesh)
        matrix = track_matrix(instance.track, time_s) @ instance.to_world
        vertices = instance.shape.vertices.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        corners.append(vertices[instance.shape.faces])
        instances.append(np.full(len(instance.shape.faces), number))
        faces.append(np.arange(len(instance.shape.faces)))
    return np.concatenate(corners), np.concatenate(instances), np.concatenate(faces)


def closest_hits(scene: Scene, origin: np.ndarray, direction: np.ndarray, time_s: float) -> Hits:
    """Nearest hit of each ray, after Möller and Trumbore."""
    corners, instances, faces = triangles_in_world(scene, time_s)
    a, edge_b, edge_c = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    count = len(origin)
    hits = Hits(np.full(count, np.inf), np.full(count, -1), np.full(count, -1), np.zeros((count, 3)))
    for ray in range(count):
        p = np.cross(direction[ray], edge_c)
        determinant = np.einsum("ij,ij->i", edge_b, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = origin[ray] - a
            weight_b = np.einsum("ij,ij->i", s, p) / determinant
            q = np.cross(s, edge_b)
            weight_c = q @ direction[ray] / determinant
            t = np.einsum("ij,ij->i", edge_c, q) / determinant
            valid = (weight_b >= 0) & (weight_c >= 0) & (weight_b + weight_c <= 1) & (t > 0)
        t = np.where(valid, t, np.inf)
        nearest = int(np.argmin(t))
        if np.isfinite(t[nearest]):
            b, c = weight_b[nearest], weight_c[nearest]
            hits.t[ray], hits.instance[ray], hits.face[ray] = t[nearest], instances[nearest], faces[nearest]
            hits.weights[ray] = (1 - b - c, b, c)
    return hits
