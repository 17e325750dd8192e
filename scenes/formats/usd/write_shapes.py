"""Writer of the shapes of a USD file: meshes, their parts with materials of their own, and curves.

Source: OpenUSD documentation, UsdGeom (Mesh, BasisCurves, Subset) and UsdShade (MaterialBindingAPI).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenes.canonical import Curves, Mesh
from scenes.canonical.values import Matrix
from scenes.formats.geometry.bodies import Body
from scenes.formats.geometry.meshed import about_middle
from scenes.formats.losses import LossReport
from scenes.formats.usd.document import UsdStage
from scenes.models.usd_library import Sdf, UsdGeom, UsdShade, Vt


def write_curves(document: UsdStage, curves: Curves, path: str, name: str, report: LossReport) -> Any:
    """Curves with their widths; those without normals are round in USD."""
    if curves.kind in ("flat", "cylinder"):
        report.add(name, f"curves of the kind {curves.kind!r}, which face the viewer", "round curves")
    made = UsdGeom.BasisCurves.Define(document.stage, path)
    made.CreateTypeAttr("linear" if curves.basis == "linear" else "cubic")
    if curves.basis != "linear":
        made.CreateBasisAttr(curves.basis)
    made.CreateWrapAttr("nonperiodic")
    made.CreateCurveVertexCountsAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(curves.counts, np.int32)))
    made.CreatePointsAttr(document.vectors(curves.points, f"points of {path}"))
    made.CreateWidthsAttr(Vt.FloatArray.FromNumpy(np.ascontiguousarray(curves.widths, np.float32)))
    made.SetWidthsInterpolation("vertex")
    wide = 0.5 * float(curves.widths.max())
    ends = np.stack([curves.points.min(axis=0) - wide, curves.points.max(axis=0) + wide])
    made.CreateExtentAttr(document.vectors(ends, f"extent of {path}"))
    if curves.normals is not None:
        made.CreateNormalsAttr(document.vectors(curves.normals, f"normals of {path}"))
        made.SetNormalsInterpolation("varying")
    return made


def write_mesh(document: UsdStage, mesh: Mesh, path: str, textured: bool) -> tuple[Any, Matrix | None]:
    """A mesh, and the place of its origin if that was moved."""
    points, middle = about_middle(mesh)
    made = UsdGeom.Mesh.Define(document.stage, path)
    vectors = document.vectors
    made.CreatePointsAttr(vectors(points, f"vertices of {path}"))
    made.CreateExtentAttr(vectors(np.stack([points.min(axis=0), points.max(axis=0)]), f"the size of {path}"))
    made.CreateFaceVertexCountsAttr(Vt.IntArray(len(mesh.faces), 3))
    made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(mesh.faces.ravel(), np.int32)))
    made.CreateSubdivisionSchemeAttr("none")
    if mesh.normals is not None:
        made.CreateNormalsAttr(vectors(mesh.normals, f"normals of {path}"))
        made.SetNormalsInterpolation("vertex")
    if textured and mesh.uvs is not None:
        kinds = Sdf.ValueTypeNames.TexCoord2fArray, "vertex"
        UsdGeom.PrimvarsAPI(made).CreatePrimvar("st", *kinds).Set(
            vectors(mesh.uvs, f"texture coordinates of {path}", "Vec2fArray")
        )
    return made, middle


def material_prims(mesh: Any, body: Body) -> list[Any]:
    """The prims to which the materials of a body are bound: a mesh, or the subsets of its faces."""
    if len(body) == 1:
        return [mesh.GetPrim()]
    made, start = [], 0
    for number, part in enumerate(body):
        faces = np.arange(start, start + len(part.shape.faces), dtype=np.int32)  # type: ignore[union-attr]
        indices = Vt.IntArray.FromNumpy(faces)
        kind = UsdGeom.Tokens.face, indices, UsdShade.Tokens.materialBind
        made.append(UsdGeom.Subset.CreateGeomSubset(mesh, f"part{number}", *kind).GetPrim())
        start += len(faces)
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).SetMaterialBindSubsetsFamilyType(UsdGeom.Tokens.partition)
    return made
