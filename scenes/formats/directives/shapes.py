"""Shapes of directive files, converted to the canonical scene.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3), section on shapes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from scenes.canonical import Disk, Mesh, SceneError, Shape, Sphere
from scenes.canonical.values import Matrix
from scenes.formats.directives.syntax import Parameters
from scenes.formats.geometry import revolution
from scenes.formats.geometry.checked import checked_mesh
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.geometry.orientation import facing_normals, turned
from scenes.formats.geometry.ply_files import read_ply
from scenes.formats.geometry.subdivision import LEVELS, loop_surface
from scenes.formats.losses import LossReport
from scenes.formats.text.scene_files import SceneFiles

UNMOVED = np.eye(4)
"""The placement of shapes that are where the current space has them."""


@dataclass
class ShapeReader:
    """Creates shapes from parameters; each mesh file is read once.

    Attributes:
        files: source of mesh files.
        report: receives the losses.
        more: functions that read the kinds of shapes of a dialect alone.
    """

    files: SceneFiles
    report: LossReport
    more: Mapping[str, Callable[[Parameters, LossReport], Shape]] = field(default_factory=dict)
    _meshes: dict[tuple[Path, bool], Mesh] = field(default_factory=dict)

    def made(self, kind: str, parameters: Parameters, turn_over: bool, beside: Path) -> tuple[Shape, Matrix] | None:
        """A shape and its placement in the current space, or None for a shape that is left out, which is reported."""
        where = str(parameters.place)
        if kind in ("trianglemesh", "mesh", "plymesh", "loopsubdiv"):
            mesh = self._ply(parameters, turn_over, beside) if kind == "plymesh" else self._triangles(parameters)
            if mesh is None:
                parameters.asked.update(parameters.given)
                return None
            if kind == "plymesh":
                return mesh, UNMOVED
            if kind == "loopsubdiv":
                mesh = self._subdivided(mesh, parameters)
            return facing_normals(turned(mesh) if turn_over else mesh), UNMOVED
        if kind == "bilinearmesh":
            return turned(self._patches(parameters)) if turn_over else self._patches(parameters), UNMOVED
        if kind in ("sphere", "disk", "cylinder", "cone", "paraboloid", "hyperboloid"):
            return self._quadric(kind, parameters, turn_over)
        if kind in self.more:
            return self.more[kind](parameters, self.report), np.eye(4)
        parameters.asked.update(parameters.given)
        if kind == "hairfile":
            self.report.add(where, f"hair ({kind})")
        elif kind in ("nurbs", "heightfield", "stlmesh", "torus", "lenscomponent"):
            self.report.add(where, f"shape {kind!r}")
        else:
            self.report.unknown(where, "shape", kind)
        return None

    def _subdivided(self, mesh: Mesh, parameters: Parameters) -> Mesh:
        """The surface of a mesh by Loop's scheme, of which PBRT draws the limit."""
        wanted = parameters.whole("levels", parameters.whole("nlevels", LEVELS, 0, 1 << 20), 0, 1 << 20)
        made, levels = loop_surface(mesh, wanted)
        became = f"triangles after {levels} level{'s' * (levels != 1)}" if levels else "its control mesh"
        self.report.add(str(parameters.place), "a subdivision surface", became)
        return made

    def _quadric(self, kind: str, parameters: Parameters, turn_over: bool) -> tuple[Shape, Matrix]:
        radius = parameters.number("radius", 1.0)
        if not radius > 0.0:
            raise SceneError(f"{parameters.place}: radius: expected a positive number, got {radius:g}")
        turn = parameters.number("phimax", 360.0)
        if not 0.0 < turn <= 360.0:
            raise SceneError(f"{parameters.place}: phimax: expected an angle in (0, 360], got {turn:g}")
        place = UNMOVED
        if kind == "sphere":
            low, high = sorted((parameters.number("zmin", -radius), parameters.number("zmax", radius)))
            whole = turn == 360.0 and low <= -radius and high >= radius
            if whole and not turn_over:
                return Sphere(radius), UNMOVED
            if not low < radius or not high > -radius or low == high:
                raise SceneError(f"{parameters.place}: zmin, zmax: expected heights within the sphere")
            if whole:
                mesh, place = as_mesh(Sphere()), np.diag([radius, radius, radius, 1.0])
            else:
                mesh = revolution.partial_sphere(radius, max(low, -radius), min(high, radius), turn)
        elif kind == "disk":
            inner, height = parameters.number("innerradius", 0.0), parameters.number("height", 0.0)
            if turn == 360.0 and inner == 0.0 and not turn_over:
                place = np.eye(4)
                place[2, 3] = height
                return Disk(radius), place
            if not 0.0 <= inner < radius:
                raise SceneError(f"{parameters.place}: innerradius: expected less than the radius, got {inner:g}")
            mesh = revolution.ring(radius, inner, height, turn)
        elif kind == "cylinder":
            heights = _apart((parameters.number("zmin", -1.0), parameters.number("zmax", 1.0)), parameters)
            mesh = revolution.cylinder(radius, min(heights), max(heights), turn)
        elif kind == "cone":
            mesh = revolution.cone(radius, *_apart((0.0, parameters.number("height", 1.0)), parameters)[1:], turn)
        elif kind == "paraboloid":
            heights = parameters.number("zmin", 0.0), parameters.number("zmax", 1.0)
            if not 0.0 <= heights[0] < heights[1]:
                raise SceneError(f"{parameters.place}: paraboloid: expected 0 <= zmin < zmax")
            mesh = revolution.paraboloid(radius, *heights, turn)
        else:
            ends = [parameters.numbers(name, 3) for name in ("p1", "p2")]
            first = np.zeros(3) if ends[0] is None else ends[0]
            second = np.ones(3) if ends[1] is None else ends[1]
            if np.array_equal(first, second):
                raise SceneError(f"{parameters.place}: hyperboloid: expected p1 and p2 apart")
            mesh = revolution.hyperboloid(first, second, turn)
        self.report.add(str(parameters.place), f"shape {kind!r}", f"a mesh of {len(mesh.faces)} triangles")
        return (turned(mesh) if turn_over else mesh), place

    def _ply(self, parameters: Parameters, turn_over: bool, beside: Path) -> Mesh | None:
        where, name = str(parameters.place), parameters.text("filename", "")
        path = self.files.known(name, where, self.report, f"the mesh {name!r}", "left out", beside)
        if path is None:
            return None
        key = path, turn_over
        if key not in self._meshes:
            mesh = read_ply(self.files.read(path, where), str(path), self.report)
            self._meshes[key] = facing_normals(turned(mesh) if turn_over else mesh)
        return self._meshes[key]

    def _indices(self, parameters: Parameters) -> np.ndarray | None:
        """Corners of triangles; each of LuxRender's quads is split into two."""
        found = [parameters.numbers(name) for name in ("indices", "triindices")]
        kept = [part for part in found if part is not None][:1]
        if all(part is not None for part in found):
            self.report.add(str(parameters.place), "triindices beside indices")
        quads = parameters.numbers("quadindices")
        if quads is not None:
            if len(quads) % 4:
                raise SceneError(f"{parameters.place}: quadindices: expected fours")
            kept.append(quads.reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].ravel())
        return np.concatenate(kept) if kept else None

    def _patches(self, parameters: Parameters) -> Mesh:
        """Bilinear patches, each as two triangles, which changes the shape of patches that are not planar."""
        points, indices = parameters.numbers("P"), parameters.numbers("indices")
        where = str(parameters.place)
        if indices is None and points is not None and len(points) == 12:
            indices = np.arange(4.0)
        if points is None or indices is None or len(points) % 3 or len(indices) % 4 or not len(indices):
            raise SceneError(f"{where}: expected points P in threes and indices in fours")
        patches, vertices = indices.reshape(-1, 4), points.reshape(-1, 3)
        arrays = []
        for name, width in (("N", 3), ("uv", 2)):
            arrays.append(self._at_corners(name, parameters.numbers(name), width, len(vertices), where))
        made = checked_mesh(vertices, patches[:, [0, 1, 3, 0, 3, 2]].reshape(-1, 3), arrays[0], arrays[1], where)
        corners = vertices[patches.astype(np.int64)]
        bent = np.abs(corners[:, 0] + corners[:, 3] - corners[:, 1] - corners[:, 2]).max(axis=1)
        if (bent > 1e-4 * np.ptp(corners, axis=1).max(axis=1)).any():
            self.report.add(where, "bilinear patches", f"a mesh of {len(made.faces)} triangles")
        return made

    def _triangles(self, parameters: Parameters) -> Mesh:
        points, indices = parameters.numbers("P"), self._indices(parameters)
        where = str(parameters.place)
        if indices is None and points is not None and len(points) == 9:  # one triangle, as in PBRT v4
            indices = np.arange(3.0)
        if points is None or indices is None or len(points) % 3 or len(indices) % 3 or not len(indices):
            raise SceneError(f"{where}: expected points P and indices, in threes")
        normals = parameters.numbers("N")
        pairs = [found for found in (parameters.numbers(name) for name in ("uv", "st")) if found is not None]
        if parameters.numbers("S") is not None:
            self.report.add(where, "tangents S of a mesh", "those of its texture coordinates")
        vertices = points.reshape(-1, 3)
        normals = self._at_corners("N", normals, 3, len(vertices), where)
        uvs = self._at_corners("uv", pairs[0] if pairs else None, 2, len(vertices), where)
        return checked_mesh(vertices, indices.reshape(-1, 3), normals, uvs, where)

    def _at_corners(self, name: str, found: np.ndarray | None, width: int, count: int, where: str) -> np.ndarray | None:
        """Values of each vertex; of another count they are left out, as in PBRT, which is reported."""
        if found is not None and len(found) != width * count:
            self.report.add(where, f"{name} of a mesh: {len(found)} numbers for {count} points")
            return None
        return None if found is None else found.reshape(-1, width)


def _apart(heights: tuple[float, float], parameters: Parameters) -> tuple[float, float]:
    if heights[0] == heights[1]:
        raise SceneError(f"{parameters.place}: expected two different heights, got {heights[0]:g} twice")
    return heights
