"""Canonical scene to Warp arrays. Whatever the kernels cannot do is refused here, in one clear line."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import warp as wp

from renderer.materials import MaterialTable
from renderer.structs import (
    LIGHT_DIRECTIONAL,
    LIGHT_POINT,
    SHAPE_CUBE,
    SHAPE_DISK,
    SHAPE_MESH,
    SHAPE_RECTANGLE,
    SHAPE_SPHERE,
    GroupRecord,
    InstanceRecord,
    LevelRecord,
    LightRecord,
    MaterialRecord,
    MeshRecord,
    SceneData,
    TextureRecord,
    TrackRecord,
)
from renderer.tracks import TrackTable
from scenes.canonical import (
    Cube,
    DirectionalLight,
    Disk,
    EnvironmentLight,
    Instance,
    Mesh,
    PointLight,
    Rectangle,
    Scene,
    SceneError,
    Sphere,
)

UNLIMITED_DEPTH = 64
"""Bounces followed where the scene sets no limit."""

_UNIT_SHAPES = {Sphere: SHAPE_SPHERE, Disk: SHAPE_DISK, Rectangle: SHAPE_RECTANGLE, Cube: SHAPE_CUBE}


@dataclass
class SceneBuffers:
    """A scene on a device.

    Attributes:
        data: what kernels read.
        tracks: rigid motions, for poses on the host.
        keep: Warp objects that ``data`` refers to by number only.
        triangle_count: of all unique meshes.
    """

    data: SceneData
    tracks: TrackTable
    keep: list[object]
    triangle_count: int


@dataclass
class _Pools:
    """Arrays of all unique meshes, one behind the other."""

    vertices: list[np.ndarray] = field(default_factory=list)
    faces: list[np.ndarray] = field(default_factory=list)
    normals: list[np.ndarray] = field(default_factory=list)
    uvs: list[np.ndarray] = field(default_factory=list)

    @staticmethod
    def append(pool: list[np.ndarray], array: np.ndarray | None) -> int:
        """Adds an array; the index its first row gets, or -1 for None."""
        if array is None:
            return -1
        first = sum(len(entry) for entry in pool)
        pool.append(array)
        return first


@dataclass
class _UnitMesh:
    """A mesh moved into ``[-1, 1]³``; ``center`` and ``scale`` lead back to object space."""

    index: int
    center: np.ndarray
    scale: float
    lower: np.ndarray
    upper: np.ndarray


def _unit_mesh(mesh: Mesh, index: int) -> tuple[_UnitMesh, np.ndarray]:
    vertices = mesh.vertices.astype(np.float64)
    used = vertices[np.unique(mesh.faces)]
    lower, upper = used.min(axis=0), used.max(axis=0)
    center, scale = (lower + upper) / 2.0, float((upper - lower).max()) / 2.0
    if scale == 0.0:
        raise SceneError(f"Mesh {mesh.source!r}: all vertices lie in one point")
    for name, array in (("normals", mesh.normals), ("uvs", mesh.uvs)):
        if array is not None and not np.isfinite(array).all():
            raise SceneError(f"Mesh {mesh.source!r}: {name} hold non-finite values")
    return _UnitMesh(index, center, scale, (lower - center) / scale, (upper - center) / scale), (
        ((vertices - center) / scale).astype(np.float32)
    )


def _upload(rows: list, record: type, device: str) -> wp.array:
    """An array of structs from tuples of field values; one zeroed row where there are none."""
    table = np.zeros(max(len(rows), 1), dtype=record.numpy_dtype())
    for index, row in enumerate(rows):
        for name, value in row.items():
            table[name][index] = value
    return wp.array(table, dtype=record, device=device)


def _pool(arrays: list[np.ndarray], width: int, dtype: type, scalar: type, device: str) -> wp.array:
    table = np.concatenate(arrays) if arrays else np.zeros((1, width))
    return wp.array(np.ascontiguousarray(table, dtype=scalar), dtype=dtype, device=device)


class _Builder:
    """Collects the tables of a scene, then uploads them."""

    def __init__(self, scene: Scene, device: str) -> None:
        self.scene, self.device = scene, device
        self.materials = MaterialTable()
        self.tracks = TrackTable(device)
        self.pools = _Pools()
        self.meshes: dict[int, _UnitMesh] = {}
        self.mesh_rows: list[dict] = []
        self.instance_rows: list[tuple[dict, np.ndarray, np.ndarray]] = []
        self.keep: list[object] = []

    def mesh(self, mesh: Mesh) -> _UnitMesh:
        """Uploads a mesh once, however many instances share it."""
        if id(mesh) in self.meshes:
            return self.meshes[id(mesh)]
        unit, vertices = _unit_mesh(mesh, len(self.mesh_rows))
        bvh = wp.Mesh(
            points=wp.array(vertices, dtype=wp.vec3, device=self.device),
            indices=wp.array(mesh.faces.reshape(-1).astype(np.int32), dtype=wp.int32, device=self.device),
        )
        self.keep.append(bvh)
        # normals of the unit mesh are those of the mesh: centring and uniform scaling do not turn them
        self.mesh_rows.append(
            {
                "id": bvh.id,
                "first_face": _Pools.append(self.pools.faces, mesh.faces),
                "first_vertex": _Pools.append(self.pools.vertices, vertices),
                "first_normal": _Pools.append(self.pools.normals, mesh.normals),
                "first_uv": _Pools.append(self.pools.uvs, mesh.uvs),
            }
        )
        self.meshes[id(mesh)] = unit
        return unit

    def instance(self, instance: Instance) -> None:
        """Adds an instance: its unit shape, transforms in float64 before rounding, and bounds in track space."""
        if instance.emission is not None:
            raise SceneError(f"Instance {instance.name!r}: area lights (Instance.emission) are not supported yet")
        shape, mesh_index = instance.shape, -1
        lower, upper = -np.ones(3), np.ones(3)
        unit_to_object = np.eye(4)
        if isinstance(shape, Mesh):
            unit = self.mesh(shape)
            kind, mesh_index, lower, upper = SHAPE_MESH, unit.index, unit.lower, unit.upper
            unit_to_object[:3, :3] *= unit.scale
            unit_to_object[:3, 3] = unit.center
        elif type(shape) in _UNIT_SHAPES:
            kind = _UNIT_SHAPES[type(shape)]
            if isinstance(shape, Sphere | Disk):
                if not shape.radius > 0.0:
                    raise SceneError(f"Instance {instance.name!r}: expected a positive radius, got {shape.radius}")
                unit_to_object[:3, :3] *= shape.radius
            if isinstance(shape, Disk | Rectangle):
                lower, upper = np.array([-1.0, -1.0, 0.0]), np.array([1.0, 1.0, 0.0])
        else:
            raise SceneError(f"Instance {instance.name!r}: shape {type(shape).__name__} is not supported")
        from_local = instance.to_world @ unit_to_object
        to_local = np.linalg.inv(from_local)
        corners = np.stack(np.meshgrid(*zip(lower, upper, strict=True), indexing="ij"), -1).reshape(-1, 3)
        placed = corners @ from_local[:3, :3].T + from_local[:3, 3]
        # a little wider, so that a flat box is not missed by a rounded ray
        margin = 4.0e-6 * (np.abs(placed).max() + np.ptp(placed, axis=0).max())
        row = {
            "shape": kind,
            "track": self.tracks.add(instance.track),
            "material": self.materials.add(instance.material, instance.name),
            "mesh": mesh_index,
            "to_local": to_local[:3, :3],
            "to_local_offset": to_local[:3, 3],
            "from_local": from_local[:3, :3],
            "from_local_offset": from_local[:3, 3],
            "extent": np.abs(from_local[:3, :3]).sum(axis=1).max(),
        }
        self.instance_rows.append((row, placed.min(axis=0) - margin, placed.max(axis=0) + margin))

    def groups(self) -> list[dict]:
        """Runs of instances on one track, from instances sorted by track."""
        groups: list[dict] = []
        for index, (row, lower, upper) in enumerate(self.instance_rows):
            if not groups or groups[-1]["track"] != row["track"]:
                groups.append({"track": row["track"], "first": index, "radius": 0.0})
            radius = 1.00001 * float(np.linalg.norm(np.maximum(np.abs(lower), np.abs(upper))))
            groups[-1]["end"] = index + 1
            groups[-1]["radius"] = max(groups[-1]["radius"], radius)
        return groups

    def lights(self) -> tuple[list[dict], EnvironmentLight | None]:
        """Rows of the lights that cast shadows, and the environment."""
        rows: list[dict] = []
        environments = []
        for light in self.scene.lights:
            if isinstance(light, PointLight):
                rows.append({"kind": LIGHT_POINT, "place": light.position, "color": light.intensity})
            elif isinstance(light, DirectionalLight):
                length = float(np.linalg.norm(light.direction))
                if not length > 0.0:
                    raise SceneError(f"DirectionalLight: expected a direction, got {light.direction}")
                towards = -np.asarray(light.direction) / length
                rows.append({"kind": LIGHT_DIRECTIONAL, "place": towards, "color": light.irradiance})
            elif isinstance(light, EnvironmentLight):
                environments.append(light)
            else:
                raise SceneError(f"light {type(light).__name__} is not supported yet")
        if len(environments) > 1:
            raise SceneError(f"expected at most one EnvironmentLight, got {len(environments)}")
        return rows, self.scene.background or (environments[0] if environments else None)

    def environment(self, light: EnvironmentLight | None, data: SceneData) -> None:
        """What rays that leave the scene see."""
        data.environment_level = -1
        if light is None:
            return
        if light.image.ndim != 3 or light.image.shape[2] != 3 or not np.isfinite(light.image).all():
            raise SceneError(f"EnvironmentLight {light.source!r}: expected a finite (h, w, 3) image")
        data.environment_level = self.materials.add_image(light.image, mipmap=False)[0]
        rotation = np.asarray(light.to_world, np.float64)[:3, :3]
        data.environment_to_map = wp.mat33(*np.linalg.inv(rotation).astype(np.float32).reshape(-1).tolist())
        data.environment_scale = float(light.scale)

    def build(self) -> SceneBuffers:
        """Fills and uploads everything."""
        scene, device = self.scene, self.device
        data = SceneData()
        self.tracks.add(getattr(scene.camera, "track", None))
        for instance in scene.instances:
            self.instance(instance)
        light_rows, environment = self.lights()
        self.environment(environment, data)
        self.instance_rows.sort(key=lambda entry: entry[0]["track"])  # stable: one pose serves a run of instances
        rows = [row for row, _, _ in self.instance_rows]
        groups = self.groups()
        data.group_count = len(groups)
        data.groups = _upload(groups, GroupRecord, device)
        data.instances = _upload(rows, InstanceRecord, device)
        data.bounds_lower = _pool([low[None] for _, low, _ in self.instance_rows], 3, wp.vec3, np.float32, device)
        data.bounds_upper = _pool([up[None] for _, _, up in self.instance_rows], 3, wp.vec3, np.float32, device)
        data.meshes = _upload(self.mesh_rows, MeshRecord, device)
        data.vertices = _pool(self.pools.vertices, 3, wp.vec3, np.float32, device)
        data.faces = _pool(self.pools.faces, 3, wp.vec3i, np.int32, device)
        data.normals = _pool(self.pools.normals, 3, wp.vec3, np.float32, device)
        data.uvs = _pool(self.pools.uvs, 2, wp.vec2, np.float32, device)
        data.materials = _upload(self.materials.rows, MaterialRecord, device)
        data.textures = _upload(self.materials.textures, TextureRecord, device)
        data.levels = _upload(self.materials.levels, LevelRecord, device)
        data.texels = _pool(self.materials.texels, 3, wp.vec3, np.float32, device)
        data.light_count = len(light_rows)
        data.lights = _upload(light_rows, LightRecord, device)
        data.tracks = _upload(self.tracks.rows, TrackRecord, device)
        self.tracks.finish()
        data.key_translation, data.key_rotation, data.key_angle = self.tracks.keys()
        data.ambient = wp.vec3(*map(float, scene.ambient))
        data.depth = UNLIMITED_DEPTH if scene.integrator.depth < 0 else int(scene.integrator.depth)
        return SceneBuffers(data, self.tracks, self.keep, sum(len(faces) for faces in self.pools.faces))


def build_buffers(scene: Scene, device: str) -> SceneBuffers:
    """Uploads a scene.

    Args:
        scene: canonical scene.
        device: from :func:`renderer.device.pick`.

    Raises:
        SceneError: for anything the renderer does not support, or values that cannot be rendered.
    """
    return _Builder(scene, device).build()
