"""Mesh files of Mitsuba scenes, each read once.

Source: Mitsuba 0.5 documentation, section on shapes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scenes.canonical import Mesh
from scenes.canonical.values import Matrix
from scenes.formats.geometry.mesh_files import obj_materials, obj_part, read_obj, read_serialized
from scenes.formats.geometry.ply_files import read_ply
from scenes.formats.geometry.shading import placed_key, placed_normals
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.properties import Properties
from scenes.formats.text.scene_files import SceneFiles


class MitsubaMeshes:
    """Reads mesh files, and shares the meshes of shapes that are placed alike."""

    def __init__(self, files: SceneFiles, report: LossReport) -> None:
        self.files, self.report = files, report
        self._meshes: dict[tuple, Mesh] = {}
        self._placed: dict[tuple, Mesh] = {}
        self._contents: dict[Path, bytes] = {}
        self._used: dict[Path, list[str]] = {}

    def materials_of(self, properties: Properties) -> list[str]:
        """Names of the materials that the faces of an OBJ file use; empty if it is missing."""
        path = self.files.known(properties.text("filename", ""), properties.where, LossReport(), "", "")
        if path is None:
            return []
        if path not in self._contents:
            self._contents[path] = self.files.read(path, properties.where)
            self._used[path] = obj_materials(self._contents[path])
        return self._used[path]

    def placed(
        self, kind: str, properties: Properties, faces: set[str] | None, place: Matrix, bare: bool, modern: bool
    ) -> tuple[Mesh, bool] | None:
        """The mesh of a shape, and whether its sides are those of the normals in its file, however it is placed.

        Args:
            kind: ``obj``, ``ply`` or ``serialized``.
            properties: properties of the shape.
            faces: materials of the faces to keep; None for all.
            place: ``(4, 4)`` object to world.
            bare: whether the shape has no material, so that 0.5 takes those of an OBJ file's library.
            modern: whether the scene is one of Mitsuba 3, which does not know flat faces of serialized meshes.

        Returns:
            None if the file is missing, which is reported.
        """
        name = properties.text("filename", "")
        path = self.files.known(name, properties.where, self.report, f"the mesh {name!r}", "left out")
        if path is None:
            return None
        index = properties.whole("shapeIndex", 0, 0, 1 << 20) if kind == "serialized" else 0
        faceted, flipped = properties.truth("faceNormals", False), properties.truth("flipTexCoords", kind == "obj")
        if properties.number("maxSmoothAngle", 0.0):
            self.report.add(properties.where, "maxSmoothAngle of a mesh", "its normals as they are")
        key = (path, index, flipped, None if faces is None else tuple(sorted(faces)))
        if key not in self._meshes:
            content = self._contents.get(path) or self.files.read(path, properties.where)
            if kind == "obj" and bare and not modern and b"mtllib" in content:
                self.report.add(properties.where, "materials of the library of a mesh", "grey, matte")
            content = content if faces is None else obj_part(content, faces)
            if kind == "serialized":
                mesh = read_serialized(content, index, str(path), modern)
            else:
                mesh = read_obj(content, str(path)) if kind == "obj" else read_ply(content, str(path), self.report)
            uvs = mesh.uvs
            if uvs is not None and flipped:
                uvs = np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1).astype(np.float32)
            self._meshes[key] = Mesh(mesh.vertices, mesh.faces, mesh.normals, uvs, str(path))
        mesh = self._meshes[key]
        placed = (*key, faceted, placed_key(mesh, place, faceted))
        if placed not in self._placed:
            self._placed[placed] = placed_normals(mesh, place, faceted)
        return self._placed[placed], mesh.normals is not None and not faceted
