"""Subdivision surfaces of USD meshes, whose default scheme is Catmull and Clark's.

Source: OpenUSD documentation, UsdGeomMesh.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import weighted
from scenes.formats.geometry.subdivision import SHARP_ALWAYS, Cage, Refined, levels_of, refined, selection
from scenes.formats.losses import LossReport
from scenes.models.usd_library import UsdGeom
from scenes.models.usd_values import array_of

SMOOTH_DEG = 30.0
"""Greatest angle between triangles of a surface that are shaded as one; greater ones are at creases."""


def surface_of(
    mesh: Any, code: Any, point_count: int, counts: NDArray[np.int64], indices: NDArray[np.int64], where: str,
    report: LossReport,
) -> Refined | None:  # fmt: skip
    """The surface of a mesh, refined as :func:`~scenes.formats.geometry.subdivision.levels_of` says, which is a loss.

    Args:
        mesh: ``UsdGeom.Mesh``.
        code: time.
        point_count: number of its points.
        counts: number of corners of each polygon.
        indices: index of the point at each corner.
        where: place for messages.
        report: receives the losses.

    Returns:
        None for a mesh without subdivision, and for one that keeps its cage, which is reported. Polygons of fewer than
        three corners are left out.
    """
    scheme = mesh.GetSubdivisionSchemeAttr().Get()
    polygons = np.flatnonzero(counts > 2)
    if scheme == "none" or not len(polygons):
        return None
    if scheme == "loop" and (counts[polygons] != 3).any():
        report.add(where, "subdivision loop of polygons that are no triangles", "the cage")
        return None
    if scheme not in ("catmullClark", "loop"):
        report.add(where, f"subdivision {scheme}", "the cage")
        return None
    corners = np.flatnonzero(np.repeat(counts > 2, counts))
    boundary = mesh.GetInterpolateBoundaryAttr().Get()
    if boundary == "none":
        report.add(where, "a surface that ends before its boundary (interpolateBoundary none)", "one up to its edges")
    edges, sharpness = _creases(mesh, code, point_count, where, report)
    corner_sharpness = _corners(mesh, code, point_count, where, report)
    cage = Cage(point_count, counts[polygons], indices[corners], edges, sharpness, corner_sharpness)
    levels = levels_of(cage, scheme)
    report.add(where, f"a subdivision surface ({scheme})", f"polygons after {levels} levels" if levels else "the cage")
    if not levels:
        return None
    varying = (one.GetInterpolation() == "faceVarying" for one in UsdGeom.PrimvarsAPI(mesh.GetPrim()).GetPrimvars())
    if mesh.GetFaceVaryingLinearInterpolationAttr().Get() != "all" and any(varying):
        report.add(where, "values at corners that bend with the surface", "linear ones within each polygon")
    if (mesh.GetTriangleSubdivisionRuleAttr().Get() or "catmullClark") != "catmullClark" and scheme != "loop":
        report.add(where, "triangles that are subdivided smoothly", "as other polygons")
    found = refined(cage, scheme, levels, boundary == "edgeAndCorner")
    own = selection(corners, len(indices))
    return replace(found, polygon=polygons[found.polygon], corners=weighted(found.corners, own).tocsr())


def _creases(
    mesh: Any, code: Any, point_count: int, where: str, report: LossReport
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Ends of sharp edges, and their sharpness: one number for each crease, or one for each of its edges."""
    along = array_of(mesh.GetCreaseIndicesAttr().Get(code), 0).astype(np.int64)
    lengths = array_of(mesh.GetCreaseLengthsAttr().Get(code), 0).astype(np.int64)
    sharpness = array_of(mesh.GetCreaseSharpnessesAttr().Get(code), 0)
    fit = (lengths >= 2).all() and lengths.sum() == len(along) and _within(along, point_count)
    parts = lengths - 1
    if fit and len(sharpness) == len(lengths):
        sharpness = np.repeat(sharpness, parts)
    if not fit or len(sharpness) != parts.sum() or not (sharpness >= 0.0).all():
        report.add(where, "creases whose numbers do not fit", "smooth edges")
        return np.zeros((0, 2), np.int64), np.zeros(0)
    last = np.cumsum(lengths) - 1
    first = np.delete(np.arange(len(along)), last)
    return np.stack([along[first], along[first + 1]], axis=1), sharpness


def _corners(mesh: Any, code: Any, point_count: int, where: str, report: LossReport) -> NDArray[np.float64]:
    """Sharpness of every point."""
    at = array_of(mesh.GetCornerIndicesAttr().Get(code), 0).astype(np.int64)
    sharpness, found = array_of(mesh.GetCornerSharpnessesAttr().Get(code), 0), np.zeros(point_count)
    if len(at) != len(sharpness) or not _within(at, point_count) or not (sharpness >= 0.0).all():
        report.add(where, "sharp corners whose numbers do not fit", "smooth ones")
        return found
    found[at] = np.where(sharpness >= SHARP_ALWAYS, np.inf, sharpness)
    return found


def _within(indices: NDArray[np.int64], count: int) -> bool:
    return bool(((indices >= 0) & (indices < count)).all())
