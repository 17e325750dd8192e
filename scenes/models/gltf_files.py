"""Reader of glTF 2.0 and GLB: one part for each primitive of each node, and lights and cameras.

Source: Khronos Group, "glTF 2.0 specification", sections 3.5 (scenes, nodes) and 3.7 (meshes).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import affine, product
from scenes.canonical import Instance, Light, Matrix, Mesh, RigidTrack, SceneError
from scenes.canonical.values import vertices_of
from scenes.formats.losses import LossReport
from scenes.models.gltf_data import GltfData
from scenes.models.gltf_materials import GltfMaterials, Painted
from scenes.models.gltf_morphs import Weights, morphed, weights_at_node
from scenes.models.gltf_motion import GltfMotion
from scenes.models.gltf_skins import bends, bent, joint_matrices
from scenes.models.gltf_textures import GltfTextures
from scenes.models.gltf_views import camera_at_node, light_at_node
from scenes.models.json_records import misplaced
from scenes.models.model import Model, ModelCamera
from scenes.models.motion import Pose, Poses, rigid_track
from scenes.models.smoothing import unit_normals, with_corners
from scenes.models.sources import Sources

_KINDS = {0: "points", 1: "lines", 2: "lines", 3: "lines"}
_READ = {"KHR_mesh_quantization", "KHR_texture_transform", "EXT_texture_webp", "KHR_lights_punctual"}
_TYPES = {"POSITION": ("VEC3",), "NORMAL": ("VEC3",), "TEXCOORD": ("VEC2",), "COLOR": ("VEC3", "VEC4")}
_DEPTH_MAX = 256
_Part = tuple[Mesh, Painted, bool]
"""A mesh, its material, and whether its back is drawn, too."""


def read_gltf(sources: Sources, report: LossReport, facets: bool = False, time_s: float = 0.0) -> Model:
    """The file's scene, or all nodes if it names no scene; parts and cameras of animated nodes move rigidly.

    Skins, morph targets and nodes that grow are as at ``time_s``, seconds since the start of the animation.

    With ``facets`` materials are converted for path tracing, otherwise to Phong.

    Parts without normals have flat faces, as the format specifies.

    Raises:
        SceneError: the file cannot be read, or requires an unsupported extension.
    """
    said: LossReport
    if sources.kept is None:
        data, said = GltfData(sources), LossReport()
        sources.kept = GltfMaterials(data, GltfTextures(data, said), said, facets), data, said
    materials, data, said = sources.kept
    _check_extensions(data, report)
    model = _Reader(data, materials, report, time_s).model()
    report.include(said.losses)
    return model


def _check_extensions(data: GltfData, report: LossReport) -> None:
    known = lambda name: name in _READ or name.startswith("KHR_materials_")  # noqa: E731
    required = [name for name in data.items("extensionsRequired") if not known(str(name))]
    if required:
        raise SceneError(f"requires the extension {', '.join(map(str, required))}, which is not known here")
    for name in sorted(map(str, data.items("extensionsUsed"))):
        if not known(name):
            report.add(data.sources.path.stem, f"the extension {name}")


class _Reader:
    """Reads nodes and meshes, each mesh once."""

    def __init__(self, data: GltfData, materials: GltfMaterials, report: LossReport, time_s: float) -> None:
        self.data, self.report, self.pose, self.materials = data, report, Pose(time_s, report), materials
        self.motion = GltfMotion(data, report)
        self._meshes: dict[tuple[int, Weights], list[_Part]] = {}
        self._parts: list[Instance] = []
        self._lights: list[Light] = []
        self._cameras: dict[str, ModelCamera] = {}
        self._world: dict[int, Matrix] = {}
        self._moving: set[int] = set()
        self._skinned: list[tuple[int, str]] = []

    def model(self) -> Model:
        for root in self._roots():
            self._node(root, np.eye(4)[None], np.eye(4), np.eye(4), None, False, 0)
        for number, name in self._skinned:
            self._add_skinned(number, name)
        return Model(tuple(self._parts), tuple(self._lights), self._cameras, "y", self.pose.counts)

    def _roots(self) -> list[int]:
        scenes, count = self.data.items("scenes"), len(self.data.items("nodes"))
        if scenes:
            number = self.data.json.get("scene", 0)
            if number >= len(scenes):
                raise misplaced("scene", f"an index of scenes below {len(scenes)}", number)
            return self.data.at("scenes", number).get("nodes", [])
        children = {child for node in range(count) for child in self.data.at("nodes", node).get("children", ())}
        return [number for number in range(count) if number not in children]

    def _node(
        self, number: int, above: Poses, frame: Matrix, now: Matrix, track: RigidTrack | None, moving: bool, depth: int
    ) -> None:
        """Adds what a node and its children hold.

        Args:
            number: index of the node.
            above: world transform of the nearest animated ancestor, at one or all times.
            frame: transform from the parent to that ancestor.
            now: transform from the parent to the world at the time of the pose.
            track: rigid motion of that ancestor.
            moving: whether there is such an ancestor.
            depth: depth of the node.
        """
        if depth > _DEPTH_MAX:
            raise SceneError(f"cannot be read: nodes[{number}]: expected nodes at most {_DEPTH_MAX} deep")
        node = self.data.at("nodes", number)
        if number in self._world:
            raise misplaced(f"nodes[{number}]", "a tree of nodes", f"node {number} twice")
        name = node.get("name", f"node{number}")
        local = self.motion.poses(number, np.array([self.pose.time_s]))[0]
        now = product(now, local)
        if self.motion.moves(number):
            moved = self.motion.poses(number, self.motion.times_s)
            above, frame, moving = product(above, product(frame, moved)), np.eye(4), True
            track = rigid_track(above, self.motion.times_s, name, self.pose)
        else:
            frame = product(frame, local)
        matrix = now if moving and track is None else product(above[0], frame)
        if not all(np.isfinite(one).all() for one in (above, matrix, now)):
            raise misplaced(f"nodes[{number}]", "a finite transform to the world", "one that overflows")
        if affine(local) is None:
            raise misplaced(f"nodes[{number}].matrix", "a last row of 0 0 0 1", "a perspective")
        self._world[number] = now
        if moving:
            self._moving.add(number)
        if "camera" in node:
            names = name if "name" in node else self.data.at("cameras", node["camera"]).get("name", name)
            if names in self._cameras:
                self.report.add(names, "a further camera of this name")
            made = camera_at_node(self.data, node["camera"], matrix, track, self.report)
            self._cameras.setdefault(names, made)
        if "KHR_lights_punctual" in node.get("extensions", {}):
            self._add_light(number, now, name, moving)
        if "mesh" in node and "skin" in node:
            self._skinned.append((number, name))
        elif "mesh" in node:
            if abs(np.linalg.det(matrix[:3, :3])) == 0.0:
                self.report.add(name, "a node without extent")
            else:
                stem = self.data.sources.path.stem
                parts = self._mesh(node["mesh"], self._weights(number, name))
                self._parts += [_placed(part, matrix, track, f"{stem}/{name}") for part in parts]
        for child in node.get("children", ()):
            self._node(child, above, frame, now, track, moving, depth + 1)

    def _add_light(self, number: int, matrix: Matrix, name: str, moving: bool) -> None:
        light = light_at_node(self.data, number, matrix, name, self.report)
        if light is not None and moving:
            self.pose.add(name, "a moving light")
        self._lights += [] if light is None else [light]

    def _add_skinned(self, number: int, name: str) -> None:
        """Adds the parts of a mesh that is bent by its joints; its node's own transform does not count."""
        node = self.data.at("nodes", number)
        if not self._moving.isdisjoint(self.data.at("skins", node["skin"]).get("joints", ())):
            self.pose.add(name, "a skin that moves")
        weights, matrices = self._weights(number, name), joint_matrices(self.data, node["skin"], self._world)
        name, parts = f"{self.data.sources.path.stem}/{name}", self._mesh_parts(node["mesh"], weights, matrices)
        self._parts += [_placed(part, np.eye(4), None, name) for part in parts]

    def _weights(self, number: int, name: str) -> Weights:
        """The weights of the morph targets at a node at the time of the pose."""
        animated = self.motion.weights(number, self.pose.time_s)
        if animated is not None and len(self.motion.times_s):
            self.pose.add(name, "morph targets that move")
        return weights_at_node(self.data, number, animated)

    def _mesh(self, number: int, weights: Weights) -> list[_Part]:
        if (number, weights) not in self._meshes:
            self._meshes[number, weights] = self._mesh_parts(number, weights, None)
        return self._meshes[number, weights]

    def _mesh_parts(self, number: int, weights: Weights, matrices: NDArray[np.float64] | None) -> list[_Part]:
        mesh = self.data.at("meshes", number)
        name = mesh.get("name", f"mesh{number}")
        made = [
            self._primitive(primitive, name, f"meshes[{number}].primitives[{place}]", weights, matrices)
            for place, primitive in enumerate(mesh.get("primitives", ()))
        ]
        return [part for part in made if part is not None]

    def _primitive(
        self, primitive: dict[str, Any], name: str, place: str, weights: Weights, matrices: NDArray[np.float64] | None
    ) -> _Part | None:
        mode, attributes = primitive.get("mode", 4), primitive["attributes"]
        if mode in _KINDS or "POSITION" not in attributes:
            self.report.add(name, _KINDS.get(mode, "a primitive without positions"))
            return None

        def of_vertices(attribute: str, count: int | None) -> NDArray[np.float64] | None:
            values = self._of_vertices(attribute, attributes, count, place)
            if values is None or not weights:
                return values
            return morphed(self.data, primitive["targets"], weights, attribute, values, place)

        points = of_vertices("POSITION", None)
        assert points is not None
        normals = of_vertices("NORMAL", len(points))
        if matrices is not None:
            points, normals = bent(bends(self.data, attributes, matrices, len(points), place), points, normals)
        if not np.isfinite(points).all():
            raise misplaced(f"{place}.attributes.POSITION", "finite points of a pose", "some that overflow")
        indices = primitive.get("indices")
        order = np.arange(len(points)) if indices is None else self.data.indices(indices, "indices")[:, 0]
        if len(order) and order.max() >= len(points):
            raise misplaced(f"{place}.indices", f"indices of vertices below {len(points)}", order.max())
        faces = _triangles(order, mode)
        if not len(faces):
            return None

        sets = {index: of_vertices(f"TEXCOORD_{index}", len(points)) for index in range(4)}
        colors = of_vertices("COLOR_0", len(points))
        material = primitive.get("material")
        doubled = material is not None and self.data.at("materials", material).get("doubleSided", False)
        painted = self.materials.painted(
            material,
            {index: values[faces] for index, values in sets.items() if values is not None},
            None if colors is None else colors[faces],
        )
        if normals is None and painted.uvs is None:
            mesh = Mesh(vertices_of(points), faces.astype(np.int32), source=str(self.data.sources.path))
            return mesh, painted, doubled
        shading = None if normals is None else unit_normals(normals[faces], points[faces])
        source = str(self.data.sources.path)
        mesh = with_corners(points[faces], shading, painted.uvs, source, None if painted.baked else faces)
        return mesh, painted, doubled

    def _of_vertices(
        self, attribute: str, attributes: dict[str, Any], count: int | None, place: str
    ) -> NDArray[np.float64] | None:
        """Values of the vertices; None without the attribute. Normals may be zero or not finite."""
        if attribute not in attributes:
            return None
        types = _TYPES[attribute.partition("_")[0]]
        values = self.data.numbers(attributes[attribute], attribute, types, finite=attribute != "NORMAL")
        if count not in (None, len(values)):
            raise misplaced(f"{place}.attributes.{attribute}", f"{count} elements", len(values))
        return values


def _placed(part: _Part, matrix: Matrix, track: RigidTrack | None, name: str) -> Instance:
    mesh, painted, doubled = part
    look = {"emission_twosided": doubled, "interior": painted.medium}
    return Instance(mesh, painted.material, matrix, track, name, **look)


def _triangles(order: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Corners of the triangles of a list (4), a strip (5) or a fan (6)."""
    if mode == 4:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    count = max(len(order) - 2, 0)
    at = np.arange(count)
    if mode == 5:
        odd = at % 2
        return np.stack([order[at], order[at + 1 + odd], order[at + 2 - odd]], axis=1)
    return np.stack([order[at + 1], order[at + 2], np.full(count, order[0] if len(order) else 0)], axis=1)
