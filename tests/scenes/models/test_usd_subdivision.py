"""Subdivision surfaces of USD files: the default scheme, creases, holes, values, and what is a loss."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.formats.losses import LossReport
from scenes.models import read_model
from scenes.models.usd_library import Usd, UsdGeom
from scenes.models.usd_meshes import at_corners, triangles_of
from tests.scenes.models.usd import mesh, written

CUBE = """
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
        point3f[] points = [(-1,-1,-1), (-1,-1,1), (-1,1,-1), (-1,1,1), (1,-1,-1), (1,-1,1), (1,1,-1), (1,1,1)]
"""
SHARP = """
        int[] creaseIndices = [0, 1, 3, 2, 0]
        int[] creaseLengths = [5]
        float[] creaseSharpnesses = [10]
"""


def read(folder: Path, inside: str = "", more: str = "", shape: str = CUBE):
    report = LossReport()
    (part,) = read_model(written(folder, mesh(inside, shape) + more), report)
    return part.shape, report.text()


def test_the_default_scheme_rounds_a_cube(tmp_path: Path) -> None:
    found, said = read(tmp_path)
    size = np.linalg.norm(found.vertices, axis=1)
    assert len(found.faces) == 6 * 64 * 2 and 0.84 < size.min() < size.max() < 0.88
    assert "a subdivision surface (catmullClark): polygons after 3 levels" in said
    assert found.normals is not None
    outwards = np.einsum("ij,ij->i", found.normals, found.vertices / size[:, None])
    assert outwards.min() > 0.97, "shaded as round"


def test_creases_are_sharp_and_shaded_so(tmp_path: Path) -> None:
    found, _ = read(tmp_path, SHARP)
    flat = found.normals[found.vertices[:, 0] < -0.999]
    assert len(flat) and np.abs(flat[:, 0]).max() > 0.99, "the side within the rim is flat"
    one, _ = read(tmp_path, SHARP.replace("[10]", "[10, 10, 10, 10]"))
    assert np.array_equal(one.vertices, found.vertices), "a number for each edge"


def test_values_follow_the_surface_or_their_polygons(tmp_path: Path) -> None:
    """Values at points are refined as points are; those of polygons, and at their corners, stay within them."""
    path, report = written(tmp_path, mesh(shape=CUBE)), LossReport()
    stage = Usd.Stage.Open(str(path))  # a prim does not keep it
    prim = UsdGeom.Mesh(stage.GetPrimAtPath("/quad"))
    triangles = triangles_of(prim, 0.0, "quad", report)
    assert triangles is not None

    def at(values: np.ndarray, interpolation: str) -> np.ndarray:
        found = at_corners(values, interpolation, triangles, "values", "quad", report)
        assert found is not None
        return found

    cage = np.array(prim.GetPointsAttr().Get(), np.float64)
    of_corners = np.arange(24.0)[:, None]
    assert at(cage, "vertex") == pytest.approx(triangles.points[triangles.at])
    assert np.abs(at(cage, "varying")).max(axis=2) == pytest.approx(1.0), "linear: still on the cube"
    assert (at(np.arange(6.0)[:, None], "uniform")[:, 0, 0] == triangles.polygon).all()
    low = 4.0 * triangles.polygon
    found = at(of_corners, "faceVarying")[..., 0]
    assert (found >= low[:, None]).all() and (found <= low[:, None] + 3.0).all() and found.max() == 23.0
    assert at_corners(cage[:7], "vertex", triangles, "values", "quad", report) is None


def test_values_that_bend_are_a_loss_unless_the_file_asks_for_linear_ones(tmp_path: Path) -> None:
    uvs = ", ".join(["(0, 0), (1, 0), (1, 1), (0, 1)"] * 6)
    inside = f'texCoord2f[] primvars:st = [{uvs}] (interpolation = "faceVarying")\n'
    said = "values at corners that bend with the surface: linear ones within each polygon"
    assert said in read(tmp_path, inside)[1] and said not in read(tmp_path)[1]
    assert said not in read(tmp_path, inside + 'uniform token faceVaryingLinearInterpolation = "all"\n')[1]


def test_holes_lie_in_the_surface_and_are_left_out(tmp_path: Path) -> None:
    whole, _ = read(tmp_path)
    found, _ = read(tmp_path, "int[] holeIndices = [0]\n")
    assert len(found.faces) == 5 * 64 * 2
    places = {tuple(point) for point in whole.vertices.round(5)}
    assert {tuple(point) for point in found.vertices.round(5)} <= places, "the rest has the shape of the whole"


def test_polygons_that_are_none_keep_the_numbers_of_others(tmp_path: Path) -> None:
    shape = CUBE.replace("[4, 4,", "[2, 4, 4,").replace("faceVertexIndices = [", "faceVertexIndices = [0, 7, ")
    found, _ = read(tmp_path, "int[] holeIndices = [1]\n", shape=shape)
    assert len(found.faces) == 5 * 64 * 2


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        ('uniform token subdivisionScheme = "bilinear"', "subdivision bilinear: the cage"),
        ('uniform token subdivisionScheme = "loop"', "loop of polygons that are no triangles: the cage"),
        ('uniform token interpolateBoundary = "none"', "ends before its boundary"),
        ('uniform token triangleSubdivisionRule = "smooth"', "triangles that are subdivided smoothly"),
        ("int[] creaseIndices = [0, 9]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [1]", "do not fit"),
        ("int[] creaseIndices = [0, 1]\nint[] creaseLengths = [3]\nfloat[] creaseSharpnesses = [1]", "do not fit"),
        ("int[] cornerIndices = [99]\nfloat[] cornerSharpnesses = [1]", "sharp corners whose numbers do not fit"),
        ("int[] cornerIndices = [0]\nfloat[] cornerSharpnesses = [nan]", "sharp corners whose numbers do not fit"),
    ],
)
def test_what_is_not_followed_is_said(inside: str, said: str, tmp_path: Path) -> None:
    found, report = read(tmp_path, inside + "\n")
    assert said in report and np.isfinite(found.vertices).all()
