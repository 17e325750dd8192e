"""Conversion of a canonical scene to Warp arrays. Unsupported parts are rejected here, with an error of one line."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
import warp as wp
from jaxtyping import Int64
from torch import Tensor

from renderer.layout.kinds import Shape
from renderer.layout.scattering import ScatterRecord
from renderer.layout.structs import (
    GroupRecord,
    InstanceRecord,
    LevelRecord,
    LightRecord,
    MaterialRecord,
    MeshRecord,
    NodeRecord,
    ReliefRecord,
    SceneData,
    TextureRecord,
    TrackRecord,
)
from renderer.tables.accelerators import Structure, number_of
from renderer.tables.checks import check_affine, check_finite, check_light
from renderer.tables.hierarchy import box_tree
from renderer.tables.lights import LightTable
from renderer.tables.materials import MaterialTable
from renderer.tables.merging import Assembly, assemble
from renderer.tables.meshes import MeshTable, UnitMesh, check_mesh
from renderer.tables.tracks import TrackTable
from scenes.arithmetic import inverse, product
from scenes.canonical import (
    Cube,
    Disk,
    HeightField,
    Instance,
    Matrix,
    Mesh,
    Rectangle,
    Scene,
    SceneError,
    Sphere,
)

DEPTH_MAX = 64
"""Greatest number of bounces, even if the scene sets no limit: it ends rays between facing mirrors."""

_UNIT_SHAPES = {Sphere: Shape.SPHERE, Disk: Shape.DISK, Rectangle: Shape.RECTANGLE, Cube: Shape.CUBE}


@dataclass
class SceneBuffers:
    """A scene on a device.

    Attributes:
        data: record that kernels read.
        tracks: rigid motions by index.
        keep: objects that ``data`` refers to by number only.
        triangle_count: number of triangles of all unique meshes.
    """

    data: SceneData
    tracks: TrackTable
    keep: list[object]
    triangle_count: int

    @cached_property
    def track_of_instance(self) -> Int64[Tensor, " instances"]:
        """Number of each instance's rigid motion."""
        return torch.from_numpy(self.data.instances.numpy()["track"].astype(np.int64))


def _upload(rows: list[dict], record: type, device: str) -> wp.array:
    """An array of structs from rows of field values; one zeroed row where there are none."""
    table = np.zeros(max(len(rows), 1), dtype=record.numpy_dtype())
    for index, row in enumerate(rows):
        for name, value in row.items():
            table[name][index] = value
    return wp.array(table, dtype=record, device=device)


class _Builder:
    """Collects the tables of a scene, then uploads them."""

    def __init__(self, scene: Scene, device: str, structure: Structure | None) -> None:
        self.scene, self.device = scene, device
        self.materials = MaterialTable(device, scene.integrator.kind == "path")
        self.lights = LightTable()
        self.tracks = TrackTable(device)
        self.meshes = MeshTable(device, structure)
        self.instance_rows: list[tuple[dict, np.ndarray, np.ndarray]] = []
        self.reliefs: list[dict] = []
        self.light_of: dict[int, int] = {}

    def assembly(self, assembly: Assembly) -> None:
        """Adds meshes that were merged into one."""
        indices = [self.materials.add(part.material, part.name) for part in assembly.parts]
        unit = self.meshes.add(assembly.mesh, np.repeat(indices, assembly.face_counts))
        row = {"shape": Shape.MESH, "track": self.tracks.add(assembly.track), "material": -1}
        self._place(row, unit, np.eye(4), assembly.parts[0].name)

    def instance(self, instance: Instance) -> None:
        """Adds an instance."""
        name, shape = instance.name, instance.shape
        row = {"track": self.tracks.add(instance.track), "material": self.materials.add(instance.material, name)}
        if instance.emission is not None:
            before = len(self.lights.rows)
            self.lights.add_emitter(instance, row["track"])
            if len(self.lights.rows) > before:
                self.light_of[len(self.instance_rows)] = before
            row["emission"] = instance.emission
        if isinstance(instance.material, HeightField):
            self._relief(row, instance, instance.material)
            return
        if isinstance(shape, Mesh):
            self._place({"shape": Shape.MESH, **row}, self.meshes.add(shape), instance.to_world, name)
            return
        if type(shape) not in _UNIT_SHAPES:
            raise SceneError(f"Instance {name!r}: shape {type(shape).__name__} is not supported")
        scale = 1.0
        if isinstance(shape, Sphere | Disk):
            check_finite(shape.radius, f"Instance {name!r}: radius")
            if not shape.radius > 0.0:
                raise SceneError(f"Instance {name!r}: expected a positive radius, got {shape.radius}")
            scale = shape.radius
        corner = np.array([1.0, 1.0, 0.0 if isinstance(shape, Disk | Rectangle) else 1.0])
        unit = UnitMesh(-1, np.zeros(3), scale, -corner, corner)
        self._place({"shape": _UNIT_SHAPES[type(shape)], **row}, unit, instance.to_world, name)

    def _relief(self, row: dict, instance: Instance, material: HeightField) -> None:
        """Adds a rectangle with a height field."""
        name = instance.name
        if not isinstance(instance.shape, Rectangle):
            raise SceneError(
                f"Instance {name!r}: HeightField: expected a Rectangle, got {type(instance.shape).__name__}"
            )
        if instance.emission is not None:
            raise SceneError(f"Instance {name!r}: expected no emission from a HeightField, got {instance.emission}")
        planes = material.height if material.height.ndim == 3 else material.height[..., None]
        level, _ = self.materials.add_image(np.repeat(planes[..., :1], 3, axis=2), mipmap=False)
        row |= {"shape": Shape.RELIEF, "relief": len(self.reliefs)}
        self.reliefs.append({"level": level, "depth": material.depth, "steps": material.steps})
        lower, upper = np.array([-1.0, -1.0, -material.depth]), np.array([1.0, 1.0, 0.0])
        self._place(row, UnitMesh(-1, np.zeros(3), 1.0, lower, upper), instance.to_world, name)

    def _place(self, row: dict, unit: UnitMesh, to_world: Matrix, name: str) -> None:
        """Adds a unit shape: its transforms in float64 before rounding, and its bounds in track space."""
        check_affine(to_world, f"Instance {name!r}: to_world")
        unit_to_object = np.eye(4)
        unit_to_object[:3, :3] *= unit.scale
        unit_to_object[:3, 3] = unit.center
        from_local = product(to_world, unit_to_object)
        to_local = inverse(from_local)
        for matrix in (from_local, to_local):
            check_finite(matrix, f"Instance {name!r}: to_world of a shape of half size {unit.scale:g}")
        corners = np.stack(np.meshgrid(*zip(unit.lower, unit.upper, strict=True), indexing="ij"), -1).reshape(-1, 3)
        placed = product(corners, from_local[:3, :3].T) + from_local[:3, 3]
        # slightly wider, so that rounding does not make a ray miss a flat box
        margin = 4.0e-6 * (np.abs(placed).max() + np.ptp(placed, axis=0).max())
        row |= {
            "mesh": unit.index,
            "to_local": to_local[:3, :3],
            "to_local_offset": to_local[:3, 3],
            "from_local": from_local[:3, :3],
            "from_local_offset": from_local[:3, 3],
            "extent": np.abs(from_local[:3, :3]).sum(axis=1).max(),
        }
        self.instance_rows.append((row, placed.min(axis=0) - margin, placed.max(axis=0) + margin))

    def groups(self) -> tuple[list[dict], list[dict]]:
        """Instances by track, as groups and the nodes of their trees."""
        groups: list[dict] = []
        nodes: list[dict] = []
        tracks = np.array([row["track"] for row, _, _ in self.instance_rows], np.int64)
        for track in np.unique(tracks):  # static instances first: they hide much of the rest
            members = np.flatnonzero(tracks == track)
            lower, upper = (np.stack([self.instance_rows[i][corner] for i in members]) for corner in (1, 2))
            # for any rotation: the farthest corner of any box
            radius = 1.00001 * float(np.linalg.norm(np.maximum(np.abs(lower), np.abs(upper)), axis=1).max())
            extent = np.ptp([lower.min(axis=0), upper.max(axis=0)], axis=0)
            surface = 2.0 * np.pi * radius**2 if track else product(extent, np.roll(extent, 1))
            first = len(nodes)
            for node in box_tree(lower, upper, float(surface)):
                instance = int(members[node.item]) if node.item >= 0 else -1
                nodes.append(
                    {"lower": node.lower, "upper": node.upper, "skip": first + node.skip, "instance": instance}
                )
            groups.append({"track": track, "first": first, "end": len(nodes), "radius": radius})
        return groups, nodes

    def build(self) -> SceneBuffers:
        """Fills and uploads everything."""
        scene, device = self.scene, self.device
        data = SceneData()
        self.tracks.add(getattr(scene.camera, "track", None))
        for instance in scene.instances:
            if isinstance(instance.shape, Mesh):
                check_affine(instance.to_world, f"Instance {instance.name!r}: to_world")
                check_mesh(instance.shape)
        assemblies, single = assemble(scene.instances)
        for instance in single:
            self.instance(instance)
        for assembly in assemblies:
            self.assembly(assembly)
        for light in scene.lights:
            self.lights.add(light)
        self.lights.place_environment(data, self.materials, scene.background)
        check_light(scene.ambient, "Scene.ambient")
        groups, nodes = self.groups()
        data.group_count = len(groups)
        data.groups = _upload(groups, GroupRecord, device)
        data.nodes = _upload(nodes, NodeRecord, device)
        data.instances = _upload([row for row, _, _ in self.instance_rows], InstanceRecord, device)
        data.meshes = _upload(self.meshes.rows, MeshRecord, device)
        data.structure = number_of(self.meshes.structure) if self.meshes.structure is not None else -1
        for name, pool in self.meshes.pools.items():
            setattr(data, name, pool.upload(device))
        data.materials = _upload(self.materials.rows, MaterialRecord, device)
        data.scattering = _upload(self.materials.scattering, ScatterRecord, device)
        lamps = np.full(max(len(self.instance_rows), 1), -1, np.int32)
        for number, light in self.light_of.items():
            lamps[number] = light
        data.light_of_instance = wp.array(lamps, dtype=wp.int32, device=device)
        data.textures = _upload(self.materials.textures, TextureRecord, device)
        data.levels = _upload(self.materials.levels, LevelRecord, device)
        data.texels = self.materials.upload_texels()
        data.reliefs = _upload(self.reliefs, ReliefRecord, device)
        data.light_count = len(self.lights.rows)
        data.lights = _upload(self.lights.rows, LightRecord, device)
        data.tracks = _upload(self.tracks.rows, TrackRecord, device)
        data.key_translation, data.key_rotation, data.key_angle = self.tracks.keys()
        data.ambient = wp.vec3(*map(float, scene.ambient))
        depth = int(scene.integrator.depth)
        data.depth = min(depth, DEPTH_MAX) if depth >= 0 else DEPTH_MAX
        data.light_cells = scene.integrator.light_cells if scene.integrator.shadow_rays == "all" else 1
        data.reflection_rays = scene.integrator.reflection_rays
        data.refraction_rays = scene.integrator.refraction_rays
        return SceneBuffers(data, self.tracks, self.meshes.keep, self.meshes.triangle_count)


def build_buffers(scene: Scene, device: str, structure: Structure | None) -> SceneBuffers:
    """Uploads a scene.

    Args:
        scene: canonical scene.
        device: from :func:`renderer.compute.device.pick`.
        structure: structure over the triangles of meshes, for CPU kernels; None for Warp's own trees.

    Raises:
        SceneError: if the renderer does not support a part of the scene, or values cannot be rendered.
    """
    return _Builder(scene, device, structure).build()
