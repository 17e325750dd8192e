"""Reader of glTF 2.0 and GLB: one part for each primitive of each node.

Source: Khronos Group, "glTF 2.0 specification", sections 3.5 (scenes, nodes) and 3.7 (meshes).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import product
from scenes.canonical import Instance, Material, Matrix, Mesh, RigidTrack, SceneError
from scenes.canonical.values import vertices_of
from scenes.formats.losses import LossReport
from scenes.models.gltf_data import GltfData
from scenes.models.gltf_materials import GltfMaterials
from scenes.models.gltf_motion import GltfMotion, Poses, local_poses
from scenes.models.smoothing import corner_normals, with_corners
from scenes.models.sources import Sources

_KINDS = {0: "points", 1: "lines", 2: "lines", 3: "lines"}
_READ = {"KHR_mesh_quantization", "KHR_texture_transform", "EXT_texture_webp", "KHR_lights_punctual"}
_DEPTH_MAX = 256


def read_gltf(sources: Sources, report: LossReport, facets: bool = False) -> tuple[Instance, ...]:
    """Parts of the file's scene, or of all nodes if it names no scene; those of animated nodes move rigidly.

    Skins and morph targets are ignored.

    With ``facets`` materials are converted for path tracing, otherwise to Phong.

    Parts without normals have flat faces, as the format specifies.

    Raises:
        SceneError: the file cannot be read, or requires an unsupported extension.
    """
    data = GltfData(sources)
    _check_extensions(data, report)
    for name in ("skins", "cameras"):
        if data.items(name):
            report.add(sources.path.stem, name)
    return _Reader(data, report, facets).parts()


def _check_extensions(data: GltfData, report: LossReport) -> None:
    known = lambda name: name in _READ or name.startswith("KHR_materials_")  # noqa: E731
    required = [name for name in data.items("extensionsRequired") if not known(str(name))]
    if required:
        raise SceneError(f"requires the extension {', '.join(map(str, required))}, which is not known here")
    for name in sorted(map(str, data.items("extensionsUsed"))):
        if not known(name) or name == "KHR_lights_punctual":
            report.add(data.sources.path.stem, f"the extension {name}")


class _Reader:
    """Reads nodes and meshes, each mesh once."""

    def __init__(self, data: GltfData, report: LossReport, facets: bool) -> None:
        self.data, self.report = data, report
        self.materials = GltfMaterials(data, report, facets)
        self.motion = GltfMotion(data, report)
        self._meshes: dict[int, list[tuple[Mesh, Material]]] = {}

    def parts(self) -> tuple[Instance, ...]:
        found: list[Instance] = []
        for root in self._roots():
            self._node(root, np.eye(4)[None], np.eye(4), None, found, 0)
        return tuple(found)

    def _roots(self) -> list[int]:
        scenes, nodes = self.data.items("scenes"), self.data.items("nodes")
        if scenes:
            return self.data.at("scenes", self.data.json.get("scene", 0)).get("nodes", [])
        children = {child for node in nodes for child in node.get("children", ())}
        return [number for number in range(len(nodes)) if number not in children]

    def _node(
        self, number: int, above: Poses, frame: Matrix, track: RigidTrack | None, found: list[Instance], depth: int
    ) -> None:
        """Adds the parts of a node and its children.

        Args:
            number: index of the node.
            above: world transform of the nearest animated ancestor, at one or all times.
            frame: transform from the parent to that ancestor.
            track: rigid motion of that ancestor.
            found: receives the parts.
            depth: depth of the node.
        """
        if depth > _DEPTH_MAX:
            raise SceneError(f"cannot be read: expected nodes at most {_DEPTH_MAX} deep")
        node = self.data.at("nodes", number)
        name = node.get("name", f"node{number}")
        moved = self.motion.poses(number)
        if moved is not None:
            above, frame = product(above, product(frame, moved)), np.eye(4)
            track = self.motion.track(above, name)
        else:
            frame = product(frame, local_poses(node)[0])
        matrix = product(above[0], frame)
        if "mesh" in node:
            if abs(np.linalg.det(matrix[:3, :3])) == 0.0:
                self.report.add(name, "a node without extent")
            else:
                stem = self.data.sources.path.stem
                parts = self._mesh(node["mesh"])
                found += [Instance(mesh, material, matrix, track, name=f"{stem}/{name}") for mesh, material in parts]
        for child in node.get("children", ()):
            self._node(child, above, frame, track, found, depth + 1)

    def _mesh(self, number: int) -> list[tuple[Mesh, Material]]:
        if number not in self._meshes:
            mesh = self.data.at("meshes", number)
            name = mesh.get("name", f"mesh{number}")
            made = [self._primitive(primitive, name) for primitive in mesh.get("primitives", ())]
            self._meshes[number] = [part for part in made if part is not None]
        return self._meshes[number]

    def _primitive(self, primitive: dict[str, Any], name: str) -> tuple[Mesh, Material] | None:
        mode, attributes = primitive.get("mode", 4), primitive.get("attributes", {})
        if mode in _KINDS or "POSITION" not in attributes:
            self.report.add(name, _KINDS.get(mode, "a primitive without positions"))
            return None
        if primitive.get("targets"):
            self.report.add(name, "morph targets")
        points = self.data.numbers(attributes["POSITION"])
        if not np.isfinite(points).all():
            raise SceneError("vertices hold non-finite values")
        indices = primitive.get("indices")
        order = np.arange(len(points)) if indices is None else self.data.numbers(indices)[:, 0].astype(np.int64)
        if len(order) and order.max() >= len(points):
            raise SceneError(f"cannot be read: {name}: a face refers to vertex {order.max()} of {len(points)}")
        faces = _triangles(order, mode)
        if not len(faces):
            return None

        def corners(attribute: str) -> NDArray[np.float64] | None:
            values = self.data.numbers(attributes[attribute]) if attribute in attributes else None
            if values is not None and len(values) != len(points):
                raise SceneError(f"cannot be read: {name}: expected {len(points)} of {attribute}, got {len(values)}")
            return None if values is None else values[faces]

        sets = {number: corners(f"TEXCOORD_{number}") for number in range(4) if f"TEXCOORD_{number}" in attributes}
        colors, normals = corners("COLOR_0"), corners("NORMAL")
        painted = self.materials.painted(
            primitive.get("material"),
            {number: values for number, values in sets.items() if values is not None},
            None if colors is None else colors[..., :3],
        )
        if normals is None and painted.uvs is None:
            mesh = Mesh(vertices_of(points), faces.astype(np.int32), source=str(self.data.sources.path))
            return mesh, painted.material
        shading = None if normals is None else _unit(normals, points[faces])
        source = str(self.data.sources.path)
        mesh = with_corners(points[faces], shading, painted.uvs, source, None if painted.baked else faces)
        return mesh, painted.material


def _unit(normals: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float32]:
    """Unit normals; face normals where the file has no usable ones."""
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    usable = np.isfinite(length) & (length > 0.0)
    if usable.all():
        return (normals / length).astype(np.float32)
    found = normals / np.where(usable, length, 1.0)
    return np.where(usable, found, corner_normals(corners)).astype(np.float32)


def _triangles(order: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Corners of the triangles of a list (4), a strip (5) or a fan (6)."""
    if mode == 4:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    count = max(len(order) - 2, 0)
    at = np.arange(count)
    if mode == 5:
        odd = at % 2
        return np.stack([order[at], order[at + 1 + odd], order[at + 2 - odd]], axis=1)
    if mode == 6:
        return np.stack([order[at + 1], order[at + 2], np.full(count, order[0] if len(order) else 0)], axis=1)
    raise SceneError(f"cannot be read: expected primitives of mode 0 to 6, got {mode}")
