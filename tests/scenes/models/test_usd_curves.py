"""Curves of USD files: their bases, ends, widths and normals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import Curves
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.losses import LossReport
from scenes.models import read_model
from tests.scenes.models.usd import mesh, written

CIRCLE = ", ".join(f"({np.cos(a):.6f}, {np.sin(a):.6f}, 0)" for a in np.arange(12) * np.pi / 6.0)

THIN = 'float[] widths = [0.2] (interpolation = "constant")'


def shapes(folder: Path, inside: str):
    report = LossReport()
    body = f'def BasisCurves "hair" {{\n{inside}\n}}\n'
    return [part.shape for part in read_model(written(folder, body + mesh(name="floor")), report)], report.text()


def read(folder: Path, inside: str):
    found, said = shapes(folder, inside)
    return [as_mesh(shape) for shape in found], said


def curves(points: str, counts: str, basis: str, wrap: str = "nonperiodic", more: str = "") -> str:
    kind = "linear" if basis == "linear" else "cubic"
    named = "" if basis == "linear" else f'uniform token basis = "{basis}"\n'
    return (
        f'uniform token type = "{kind}"\n{named}uniform token wrap = "{wrap}"\nint[] curveVertexCounts = {counts}\n'
        f"point3f[] points = [{points}]\n{more or THIN}\n"
    )


@pytest.mark.parametrize("basis", ["bspline", "catmullRom"])
def test_a_closed_curve_of_points_on_a_circle_is_nearly_a_circle(basis: str, tmp_path: Path) -> None:
    (found, _), _ = read(tmp_path, curves(CIRCLE, "[12]", basis, "periodic"))
    radius = np.hypot(*found.vertices[:, :2].T)
    middle = (2.0 + np.cos(np.pi / 6.0)) / 3.0 if basis == "bspline" else 1.0
    assert radius.max() == pytest.approx(middle + 0.1, abs=0.01) and radius.min() == pytest.approx(
        middle - 0.1, abs=0.01
    )
    assert np.abs(found.vertices[:, 2]).max() == pytest.approx(0.1, abs=1e-4)


@pytest.mark.parametrize("basis", ["bspline", "catmullRom", "bezier", "linear"])
def test_a_straight_curve_has_its_length_and_its_width(basis: str, tmp_path: Path) -> None:
    """Four points at 0, 1, 2 and 3: those of a B-spline and of Catmull and Rom end at 1 and 2."""
    (found, _), _ = read(tmp_path, curves("(0,0,0), (1,0,0), (2,0,0), (3,0,0)", "[4]", basis))
    first, last = (1.0, 2.0) if basis in ("bspline", "catmullRom") else (0.0, 3.0)
    assert (found.vertices[:, 0].min(), found.vertices[:, 0].max()) == pytest.approx((first, last))
    assert np.hypot(*found.vertices[:, 1:].T) == pytest.approx(0.1, abs=1e-5)


@pytest.mark.parametrize("basis", ["bspline", "catmullRom"])
def test_a_pinned_curve_reaches_its_ends(basis: str, tmp_path: Path) -> None:
    points = "(0,0,0), (1,0,0), (2,0,0), (0,5,0), (1,5,0), (2,5,0)"
    (found, _), _ = read(tmp_path, curves(points, "[3, 3]", basis, "pinned"))
    assert (found.vertices[:, 0].min(), found.vertices[:, 0].max()) == pytest.approx((0.0, 2.0), abs=1e-6)
    assert set(found.vertices[:, 1].round()) == {0.0, 5.0}


@pytest.mark.parametrize(
    ("values", "interpolation"),
    [("0.2, 0.2, 0.4, 0.4", "vertex"), ("0.2, 0.4", "uniform"), ("0.2, 0.2, 0.4, 0.4", "varying")],
)
def test_widths_by_their_interpolation(values: str, interpolation: str, tmp_path: Path) -> None:
    more = f'float[] widths = [{values}] (interpolation = "{interpolation}")'
    (found, _), _ = read(tmp_path, curves("(0,0,0), (1,0,0), (0,5,0), (1,5,0)", "[2, 2]", "linear", more=more))
    low, high = (found.vertices[found.vertices[:, 1] < 2.0], found.vertices[found.vertices[:, 1] > 2.0])
    assert (np.ptp(low[:, 2]), np.ptp(high[:, 2])) == pytest.approx((0.2, 0.4))


def test_curves_with_normals_are_ribbons(tmp_path: Path) -> None:
    more = f'{THIN}\nnormal3f[] normals = [(0,0,1), (0,0,1)] (interpolation = "vertex")'
    (found, _), said = read(tmp_path, curves("(0,0,0), (1,0,0)", "[2]", "linear", more=more))
    assert len(found.faces) == 2 and found.vertices[:, 2] == pytest.approx(0.0) and not said
    assert np.ptp(found.vertices[:, 1]) == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("wrap", "basis", "counts"),
    [("nonperiodic", "bspline", [5, 4]), ("pinned", "bezier", [13, 10]), ("periodic", "bezier", [16, 13])],
)
def test_b_splines_that_are_open_stay_such(wrap: str, basis: str, counts: list[int], tmp_path: Path) -> None:
    points = ", ".join(f"({n}, {n % 3}, 0)" for n in range(9))
    (found, _), _ = shapes(tmp_path, curves(points, "[5, 4]", "bspline", wrap))
    assert isinstance(found, Curves) and (found.basis, found.counts.tolist()) == (basis, counts)


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        (curves("(0,0,0), (1,0,0), (2,0,0)", "[3]", "bezier"), "whose numbers do not fit"),
        (curves("(0,0,0), (1,0,0)", "[3]", "linear"), "whose numbers do not fit"),
        (curves("(0,0,0)", "[1]", "linear", "periodic"), "whose numbers do not fit"),
        (curves("(0,0,0), (1,0,0)", "[2147483647, 2147483647]", "linear"), "whose numbers do not fit"),  # 64 GB
        (curves("(0,0,0), (1,0,0)", "[2]", "linear", more="float[] widths = [1, 2, 3]"), "whose number does not fit"),
        (curves("(0,0,0), (1,0,0)", "[2]", "linear", more="bool unused = 1"), "curves without widths"),
        (curves("(0,0,0), (1,0,0)", "[2]", "linear", more="float[] widths = [1, -1]"), "below zero: widths of 0"),
        (curves("(0,0,0), (1,0,0)", "[2]", "linear", more=f"{THIN}\nnormal3f[] normals = [(0,0,1), (0,0,1), (0,0,1)]"),
         "3 normals of curves, whose number does not fit: tubes"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_said(inside: str, said: str, tmp_path: Path) -> None:
    found, report = read(tmp_path, inside)
    assert said in report and all(np.isfinite(one.vertices).all() for one in found)
