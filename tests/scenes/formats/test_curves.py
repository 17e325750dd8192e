"""Curves: their bases, the formats that have them, and their meshes for those that have none."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    ConstantTexture,
    Curves,
    EnvironmentLight,
    Instance,
    Matte,
    Mesh,
    PerspectiveCamera,
    Scene,
    SceneError,
)
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.drawable import drawable
from scenes.formats.geometry.curves import SIDES, as_bezier, as_bspline, bezier_segments
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import drawn, pbrt, seen

GREY = Matte(ConstantTexture((0.5, 0.4, 0.3)))
CURVE = 'Shape "curve" "point P" [ 0 0 0 1 1 0 2 -1 0 3 0 0 ] '


def some(basis: str, *counts: int, kind: str = "cylinder") -> Curves:
    """Curves of random points, whose widths run evenly from 0.3 to 0.4."""
    rng, n = np.random.default_rng(7), sum(counts)
    normals, step, first = None, (3.0 if basis == "bezier" else 1.0), (1.0 if basis == "bspline" else 0.0)
    ends = [count - 3.0 if basis == "bspline" else (count - 1.0) / step for count in counts]
    shares = [(np.arange(count) - first) / step / end for count, end in zip(counts, ends, strict=True)]
    widths = 0.3 + 0.1 * np.concatenate(shares)
    points = rng.normal(size=(n, 3)).astype(np.float32)
    made = Curves(points, widths.astype(np.float32), np.array(counts, np.int32), basis)  # type: ignore[arg-type]
    if kind == "ribbon":
        normals = rng.normal(size=(int((made.segments + 1).sum()), 3)).astype(np.float32)
    return dataclasses.replace(made, kind=kind, normals=normals)


def scene_of(curves: Curves, *scale: float) -> Scene:
    place = np.diag([*(scale or (1.0, 1.0, 1.0)), 1.0])
    view = np.eye(4)
    view[2, 3] = 8.0
    lights = (EnvironmentLight(np.ones((1, 1, 3), np.float32)),)
    return Scene(PerspectiveCamera(view, 60.0), (Instance(curves, GREY, place),), lights)


def through(scene: Scene, file: Path, name: str) -> tuple[Scene, list[str]]:
    """A scene written and read again, and what was lost of the picture."""
    report = LossReport()
    save_scene_file(scene, file, name, report)
    return load_scene_file(file, None, report), [loss.what for loss in report.losses if loss.picture]


# --- bases -----------------------------------------------------------------------------------------------------------


def test_segments_are_those_of_the_uniform_cubic_b_spline() -> None:
    curves = some("bspline", 6)
    segments, _ = bezier_segments(curves)
    t = 0.3
    basis = np.array([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]) / 6.0
    bernstein = np.array([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    for number in range(3):
        wanted = basis @ curves.points[number : number + 4].astype(np.float64)
        np.testing.assert_allclose(bernstein @ segments[number, :, :3], wanted, atol=1e-7)


@pytest.mark.parametrize("basis", ["linear", "bezier", "bspline"])
def test_other_bases_are_the_same_curves(basis: str) -> None:
    curves = some(basis, 7, 4)
    wanted = bezier_segments(curves)[0]
    for other in (as_bezier(curves), as_bspline(curves)):
        np.testing.assert_allclose(bezier_segments(other)[0], wanted, atol=1e-5)


def test_b_splines_come_back_from_bezier_curves() -> None:
    for kind in ("cylinder", "ribbon"):
        curves = some("bspline", 6, 4, 5, kind=kind)
        assert difference(as_bspline(as_bezier(curves)), curves) is None
    assert as_bspline(some("bezier", 7)).counts.tolist() == [4, 4]  # its curvature jumps


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"counts": np.array([5], np.int32)}, "n counted points"),
        ({"basis": "bezier", "points": np.zeros((5, 3), np.float32), "widths": np.zeros(5, np.float32),
          "counts": np.array([5], np.int32)}, "4, 7, 10"),
        ({"counts": np.array([2, 2], np.int32)}, "at least one segment"),
        ({"kind": "ribbon"}, "expected normals for ribbons"),
        ({"widths": np.full(4, -1.0, np.float32)}, "non-negative widths"),
    ],
)  # fmt: skip
def test_impossible_curves_are_refused(change: dict, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        dataclasses.replace(some("bspline", 4), **change)


# --- PBRT ------------------------------------------------------------------------------------------------------------


def test_curves_of_pbrt(tmp_path: Path) -> None:
    ribbon = '"string type" "ribbon" "normal N" [ 0 0 1 0 1 0 ] "float width0" .1 "float width1" .4'
    scene, lost = pbrt(tmp_path, f'{CURVE}"float width" .2\n{CURVE}\n{CURVE}{ribbon}\n')
    first, second = (one.shape for one in scene.instances)
    assert isinstance(first, Curves) and isinstance(second, Curves) and not lost
    assert (first.kind, first.basis, first.counts.tolist()) == ("flat", "bezier", [4, 4])  # both in one
    np.testing.assert_allclose(first.widths, [0.2] * 4 + [1.0] * 4, rtol=1e-6)
    np.testing.assert_allclose(second.widths, [0.1, 0.2, 0.3, 0.4], rtol=1e-6)
    assert second.normals is not None and second.normals.tolist() == [[0, 0, 1], [0, 1, 0]]


def test_quadratic_curves_are_cubic_ones(tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [1, 2, 0], [3, 0, 1], [4, 1, 0]], float)
    text = (
        f'Shape "curve" "integer degree" 2 "string basis" "bspline" "point P" [ {" ".join(map(str, points.ravel()))} ]'
    )
    (found,) = pbrt(tmp_path, text)[0].instances
    segments, _ = bezier_segments(found.shape)  # type: ignore[arg-type]
    t = 0.4
    for number in range(2):
        a, b, c = points[number : number + 3]
        wanted = 0.5 * (1 - t) ** 2 * a + 0.5 * (1 + 2 * t - 2 * t * t) * b + 0.5 * t * t * c
        got = np.array([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3]) @ segments[number, :, :3]
        np.testing.assert_allclose(got, wanted, atol=1e-6)


@pytest.mark.parametrize("inner", ['"string basis" "hermite"', '"integer degree" 4', '"string type" "ribbon"',
                                   '"float width" -1', '"integer degree" 2'])  # fmt: skip
def test_impossible_curves_of_pbrt_are_one_line(inner: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"a.pbrt:4:1: .*expected"):
        pbrt(tmp_path, CURVE + inner)


@pytest.mark.parametrize("name", ["pbrt", "pbrt4"])
@pytest.mark.parametrize("kind", ["flat", "cylinder", "ribbon"])
@pytest.mark.parametrize("basis", ["bezier", "bspline"])
def test_curves_come_back_from_pbrt(basis: str, kind: str, name: str, tmp_path: Path) -> None:
    scene = scene_of(some(basis, 7, 4, kind=kind), 2.0, 2.0, 2.0)
    found, lost = through(scene, tmp_path / "a.pbrt", name)
    assert not lost and difference(found.instances, scene.instances) is None


def test_a_taper_to_nothing_is_kept(tmp_path: Path) -> None:
    """Its widths at control points of the B-spline would be negative: it is a chain of Bézier curves."""
    text = CURVE.replace("3 0 0 ]", "3 0 0 4 1 0 ]") + '"string basis" "bspline" "float width0" .2 "float width1" 0'
    scene, _ = pbrt(tmp_path, text)
    assert scene.instances[0].shape.basis == "bezier"  # type: ignore[union-attr]
    segments, _ = bezier_segments(scene.instances[0].shape)  # type: ignore[arg-type]
    np.testing.assert_allclose(segments[[0, 0, 1, 1], [0, 3, 0, 3], 3], [0.2, 0.1, 0.1, 0.0], atol=1e-7)


def test_uneven_widths_are_cut_for_pbrt(tmp_path: Path) -> None:
    curves = some("bspline", 6)
    curves = dataclasses.replace(curves, widths=np.array([0.1, 0.3, 0.1, 0.5, 0.1, 0.2], np.float32))
    found, lost = through(scene_of(curves), tmp_path / "a.pbrt", "pbrt")
    assert lost == ["widths that do not run evenly"] and found.instances[0].shape.counts.tolist() == [4] * 3  # type: ignore


# --- Mitsuba ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("basis", ["linear", "bspline"])
def test_curves_come_back_from_mitsuba_3(basis: str, tmp_path: Path) -> None:
    """Its radii are not scaled by the transform, those of the canonical scene are."""
    scene = scene_of(some(basis, 7, 4, kind="tube"), 3.0, 3.0, 3.0)
    found, lost = through(scene, tmp_path / "a.xml", "mitsuba3")
    assert not lost and difference(found.instances, scene.instances) is None
    (text,) = (tmp_path / "models").iterdir()
    first = float(text.read_text().split()[3])
    assert first == pytest.approx(1.5 * float(scene.instances[0].shape.widths[0]), rel=1e-6)  # type: ignore[union-attr]


@pytest.mark.parametrize("content", ["", "0 0 0 1\n1 0 0 1\n", "0 0 0\n" * 4, "0 0 0 x\n" * 4, "0 0 0 -1\n" * 4,
                                     "1e39 0 0 1\n" * 4, "0 0 0 1e39\n" * 4])  # fmt: skip
def test_impossible_files_of_curves_are_one_line(content: str, tmp_path: Path) -> None:
    (tmp_path / "c.txt").write_text(content)
    shape = '<shape type="bsplinecurve"><string name="filename" value="c.txt"/></shape>'
    (tmp_path / "a.xml").write_text(f'<scene version="3.0.0">{shape}</scene>')
    with pytest.raises(SceneError, match=r"c.txt.*expected"):
        load_scene_file(tmp_path / "a.xml")


def test_hair_of_mitsuba_0_5(tmp_path: Path) -> None:
    (tmp_path / "h.txt").write_text("0 0 0\n1 0 0\n1 1 0\n\n\n0 0 1\n1 0 1\n")
    shape = '<shape type="hair"><string name="filename" value="h.txt"/><float name="radius" value="0.1"/></shape>'
    (tmp_path / "a.xml").write_text(f'<scene version="0.5.0">{shape}</scene>')
    found = load_scene_file(tmp_path / "a.xml").instances[0].shape
    assert isinstance(found, Curves) and found.counts.tolist() == [3, 2]
    np.testing.assert_allclose(found.widths, 0.2, rtol=1e-6)


# --- meshes ----------------------------------------------------------------------------------------------------------


def test_a_straight_tube_is_a_prism() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], np.float32)
    mesh = as_mesh(Curves(points, np.full(4, 0.5, np.float32), np.array([4], np.int32), "bezier"))
    away = np.hypot(mesh.vertices[:, 1], mesh.vertices[:, 2])
    np.testing.assert_allclose(away, 0.25, rtol=1e-5)
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(normals, axis=1).sum()
    assert area == pytest.approx(3.0 * 2.0 * SIDES * 0.25 * np.sin(np.pi / SIDES), rel=1e-5)
    middle = corners.mean(axis=1)
    assert ((normals[:, 1:] * middle[:, 1:]).sum(axis=1) > 0.0).all()  # faces outwards


def test_many_curves_have_longer_chords(monkeypatch: pytest.MonkeyPatch) -> None:
    """100,000 segments would else be 77 million triangles, for the sake of the one that bends most."""
    curves = some("bspline", 8)
    finest = len(as_mesh(curves).faces)
    monkeypatch.setattr("scenes.formats.geometry.curves.TRIANGLES_MOST", finest // 2)
    assert finest // 4 < len(as_mesh(dataclasses.replace(curves)).faces) <= finest // 2
    monkeypatch.setattr("scenes.formats.geometry.curves.TRIANGLES_MOST", 1)
    assert len(as_mesh(dataclasses.replace(curves)).faces) == 5 * 2 * SIDES


def test_a_ribbon_is_a_strip_across_its_normals() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], np.float32)
    up = np.array([[0, 0, 1], [0, 0, 1]], np.float32)
    mesh = as_mesh(Curves(points, np.full(4, 0.5, np.float32), np.array([4], np.int32), "bezier", "ribbon", up))
    assert np.abs(mesh.vertices[:, 2]).max() == 0.0 and np.abs(np.abs(mesh.vertices[:, 1]) - 0.25).max() < 1e-6


@pytest.mark.parametrize("name", ["luxrender", "mitsuba", "gltf", ""])
def test_formats_without_curves_get_meshes(name: str, tmp_path: Path) -> None:
    scene, endings = scene_of(some("bspline", 6, 4)), {"luxrender": ".lxs", "mitsuba": ".xml", "gltf": ".gltf"}
    if name:
        found, lost = through(scene, tmp_path / f"a{endings[name]}", name)
    else:
        report = LossReport()
        found, lost = drawable(scene, report), [loss.what for loss in report.losses]
    assert isinstance(found.instances[0].shape, Mesh) and any("curves" in what for what in lost)


def test_pictures_of_curves_and_of_their_meshes_are_alike(tmp_path: Path) -> None:
    """Round curves of a file for Mitsuba 3, as it draws them, as they are written again, and as meshes in LuxCore."""
    rows = ["-1.5 -1 0 .3", "-.5 -.6 0 .2", ".5 .4 0 .2", "1.2 -.2 0 .3", "1.4 1.3 0 .4", "1 2 0 .1"]
    (tmp_path / "c.txt").write_text("\n".join(rows) + "\n\n" + "\n".join(row.replace(" 0 .", " 1 .") for row in rows))
    (tmp_path / "a.xml").write_text("""<scene version="3.0.0"><integrator type="path"/><sensor type="perspective">
    <transform name="to_world"><lookat origin="0,0,8" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/></film></sensor>
    <emitter type="constant"/><shape type="bsplinecurve"><string name="filename" value="c.txt"/>
    <transform name="to_world"><rotate z="1" angle="30"/><scale value="1.3"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0 0 0"/></bsdf></shape></scene>""")
    scene = load_scene_file(tmp_path / "a.xml")
    wanted = seen("mitsuba", tmp_path / "a.xml", 32, 64)
    assert 0.05 < 1.0 - wanted.mean() < 0.5
    for program in ("mitsuba", "luxcore"):
        found = drawn(scene, program, tmp_path / program, 32, 64)
        assert np.abs(found - wanted).mean() < 0.02, program


@pytest.mark.parametrize("kind", ["tube", "cylinder", "ribbon"])
@pytest.mark.parametrize("basis", ["linear", "bezier", "bspline"])
def test_curves_come_back_from_usd(basis: str, kind: str, tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    curves = some(basis, 7, 4, kind=kind)
    found, lost = through(scene_of(curves), tmp_path / "a.usda", "usd")
    wanted = dataclasses.replace(curves, kind="tube") if kind == "cylinder" else curves
    assert difference(found.instances[0].shape, dataclasses.replace(wanted, source="")) is None
    assert lost == (["curves of the kind 'cylinder', which face the viewer"] if kind == "cylinder" else [])


@pytest.mark.parametrize(("name", "word"), [("pbrt", '"curve"'), ("pbrt4", '"curve"'), ("luxrender", '"plymesh"'),
                                            ("mitsuba", 'type="ply"')])  # fmt: skip
def test_curves_of_several_instances_are_written_once(name: str, word: str, tmp_path: Path) -> None:
    one = scene_of(some("bspline", 6, 5))
    places = [np.diag([1.0, 1.0, 1.0 + number, 1.0]) for number in range(3)]
    instances = tuple(dataclasses.replace(one.instances[0], to_world=place) for place in places)
    wanted = dataclasses.replace(one, instances=instances)
    file = tmp_path / ("a.xml" if name == "mitsuba" else "a.lxs" if name == "luxrender" else "a.pbrt")
    read, _ = through(wanted, file, name)
    assert file.read_text().count(word) == (2 if "pbrt" in name else 1)
    assert len(read.instances) == 3 and read.instances[0].shape is read.instances[2].shape
    assert "pbrt" not in name or difference(wanted.instances, read.instances) is None
