"""Polygons of a USD mesh as triangles, and the values at their corners.

Source: OpenUSD documentation, UsdGeomMesh and UsdGeomPrimvar.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Int
from numpy.typing import NDArray

from scenes.arithmetic import weighted
from scenes.canonical import SceneError
from scenes.formats.geometry.polygons import triangles_of as cut_polygons
from scenes.formats.geometry.subdivision import Refined
from scenes.formats.losses import LossReport
from scenes.models.smoothing import corner_normals
from scenes.models.usd_library import UsdGeom
from scenes.models.usd_subdivision import SMOOTH_DEG, surface_of
from scenes.models.usd_values import array_of

_POLYGONS_MOST = 1 << 28


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles of polygons.

    Attributes:
        points: points of the mesh ``(p, 3)``.
        at: index of the point at each corner.
        corner: index of each corner among the corners of all polygons.
        polygon: index of the polygon of each triangle.
        polygons: number of polygons, of which some may have no triangles.
        surface: the subdivision surface whose polygons they are; None for polygons as they are. Values of primvars
            are of its cage, and the index of a polygon is that of the cage.
    """

    points: NDArray[np.float64]
    at: Int[NDArray[np.int64], "f 3"]
    corner: Int[NDArray[np.int64], "f 3"]
    polygon: Int[NDArray[np.int64], " f"]
    polygons: int
    surface: Refined | None = None

    def of(self, kept: NDArray[np.bool_]) -> Triangles:
        """Some of the triangles."""
        return replace(self, at=self.at[kept], corner=self.corner[kept], polygon=self.polygon[kept])


def triangles_of(mesh: Any, code: Any, where: str, report: LossReport) -> Triangles | None:
    """The triangles of a mesh: polygons are cut into triangles, and holes are left out.

    Args:
        mesh: ``UsdGeom.Mesh``.
        code: time.
        where: place for messages.
        report: receives the losses.

    Returns:
        None if there are none.

    Raises:
        SceneError: counts or indices do not match, or points are not finite.
    """
    points = array_of(mesh.GetPointsAttr().Get(code), 3)
    counts = array_of(mesh.GetFaceVertexCountsAttr().Get(code), 0).astype(np.int64)
    indices = array_of(mesh.GetFaceVertexIndicesAttr().Get(code), 0).astype(np.int64)
    if not np.isfinite(points).all():
        raise SceneError(f"{where}: vertices hold non-finite values")
    if len(counts) and (counts.min() < 0 or len(counts) > _POLYGONS_MOST):
        raise SceneError(f"cannot be read: {where}: expected polygons of at least 0 corners, got {counts.min()}")
    if counts.sum() != len(indices):
        raise SceneError(f"cannot be read: {where}: expected {counts.sum()} indices of corners, got {len(indices)}")
    if len(indices) and not (indices.min() >= 0 and indices.max() < len(points)):
        wrong = indices[(indices < 0) | (indices >= len(points))][0]
        raise SceneError(f"cannot be read: {where}: a face refers to vertex {wrong} of {len(points)}")
    holes = array_of(mesh.GetHoleIndicesAttr().Get(code), 0).astype(np.int64)
    hole = np.isin(np.arange(len(counts)), holes)
    polygons, of_polygon = len(counts), np.arange(len(counts))
    surface = surface_of(mesh, code, len(points), counts, indices, where, report)
    if surface is not None:
        points, counts, indices = weighted(surface.smooth, points), surface.cage.counts, surface.cage.indices
        of_polygon = surface.polygon
    few = int(((counts < 3) & ~hole[of_polygon]).sum())
    if few:
        report.add(where, f"faces of fewer than three corners ({few})")
    drawn = (counts >= 3) & ~hole[of_polygon]
    if not drawn.any():
        return None
    at = np.flatnonzero(np.repeat(drawn, counts))
    cut = cut_polygons(points, indices[at], counts[drawn])
    if cut.uncovered:
        report.add(where, f"{cut.uncovered} concave polygons of many corners", "fans about their first corner")
    corner, polygon = at[cut.corners], np.flatnonzero(drawn)[cut.polygon]
    if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        corner = corner[:, ::-1]
    return Triangles(points, indices[corner], corner, of_polygon[polygon], polygons, surface)


def at_corners(
    values: NDArray[np.float64], interpolation: str, triangles: Triangles, what: str, where: str, report: LossReport
) -> NDArray[np.float64] | None:
    """Values ``(f, 3, width)`` at the corners; None, with a loss, if their number does not fit. They may be non-finite.

    Args:
        values: values ``(n, width)`` without indices.
        interpolation: of the primvar.
        triangles: triangles.
        what: name of the values, for the loss.
        where: place for messages.
        report: receives the loss.
    """
    polygon = np.repeat(triangles.polygon[:, None], 3, axis=1)
    index = {"constant": np.zeros_like(polygon), "uniform": polygon, "faceVarying": triangles.corner}.get(
        interpolation, triangles.at
    )
    refine = triangles.surface and triangles.surface.of(interpolation)
    if len(values) < (index.max(initial=0) + 1 if refine is None else refine.shape[1]):
        report.add(where, f"{what} ({interpolation}) with {len(values)} values")
        return None
    return (values if refine is None else weighted(refine, values[: refine.shape[1]]))[index]


def primvar_at_corners(
    prim: Any, name: str, width: int, triangles: Triangles, code: Any, where: str, report: LossReport
) -> NDArray[np.float64] | None:
    """Values ``(f, 3, width)`` of a primvar, inherited where it is constant; None if there is none that fits.

    Raises:
        SceneError: values other than normals are not finite.
    """
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not primvar or not primvar.HasValue():
        return None
    flat = primvar.ComputeFlattened(code)
    found = None if flat is None else np.array(flat, np.float64)
    if found is None or found.ndim != (2 if width > 1 else 1) or (width > 1 and found.shape[1] < width):
        report.add(where, f"primvar {name} of type {primvar.GetTypeName()}")
        return None
    values = found.reshape(len(found), -1)[:, :width]
    if name != "normals" and not np.isfinite(values).all():
        raise SceneError(f"{where}: primvar {name}: holds non-finite values")
    return at_corners(values, primvar.GetInterpolation(), triangles, f"primvar {name}", where, report)


def normals_at_corners(
    mesh: Any, triangles: Triangles, code: Any, where: str, report: LossReport
) -> NDArray[np.float64] | None:
    """Normals ``(f, 3, 3)`` of a mesh, not normalised and not all finite; None if it has none. Those of a subdivision
    surface are its own, as in USD: normals of the file do not count."""
    if triangles.surface is not None:
        return corner_normals(triangles.points[triangles.at], SMOOTH_DEG).astype(np.float64)
    primvar = UsdGeom.PrimvarsAPI(mesh.GetPrim()).GetPrimvar("normals")
    if primvar and primvar.HasValue():
        found = primvar_at_corners(mesh.GetPrim(), "normals", 3, triangles, code, where, report)
    else:
        values = array_of(mesh.GetNormalsAttr().Get(code), 3)
        interpolation = mesh.GetNormalsInterpolation()
        found = at_corners(values, interpolation, triangles, "normals", where, report) if len(values) else None
    if found is not None and not np.isfinite(found).all():
        report.add(where, "non-finite normals", "those of the faces")
    return found


def subsets_of(mesh: Any, code: Any, polygons: int, report: LossReport) -> list[tuple[Any, NDArray[np.bool_]]]:
    """Subsets of a mesh to which materials are bound: each prim, and a mark for each polygon. Those of other polygons
    than the mesh has are reported."""
    found = []
    for subset in UsdGeom.Subset.GetGeomSubsets(mesh, UsdGeom.Tokens.face, "materialBind"):
        indices = array_of(subset.GetIndicesAttr().Get(code), 0).astype(np.int64)
        marks, there = np.zeros(polygons, bool), (indices >= 0) & (indices < polygons)
        if not there.all():
            report.add(subset.GetPrim().GetName(), f"{np.count_nonzero(~there)} polygons that the mesh does not have")
        marks[indices[there]] = True
        found.append((subset.GetPrim(), marks))
    return found
