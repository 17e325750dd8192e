"""Small scenes that users of converters reported, each with what is right; the sources are in ``cases/README.md``."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    Bumped,
    CheckerboardTexture,
    ConstantTexture,
    Matte,
    Metal,
    MixMaterial,
    OrthographicCamera,
    PerspectiveCamera,
    Rectangle,
    SceneError,
)
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import CASES, HEAD, case, drawn, mitsuba, pbrt, reflectances

# --- names -----------------------------------------------------------------------------------------------------------


def test_names_end_with_their_attribute_block() -> None:
    scene, lost = case("names-scoped-by-attribute-block")
    assert reflectances(scene) == [(0.2, 0.2, 0.7), (0.7, 0.2, 0.2), (0.8, 0.1, 0.1)] and not lost


@pytest.mark.parametrize("block", ["Attribute", "Object"])
def test_names_end_with_every_block_that_keeps_attributes(block: str, tmp_path: Path) -> None:
    """A block of a transform alone keeps them; names of one block do not reach the next."""
    name = ' "o"' if block == "Object" else ""
    body = f"""MakeNamedMaterial "m" "string type" "matte" "rgb Kd" [0.1 0.1 0.1]
    {block}Begin{name}
      TransformBegin MakeNamedMaterial "m" "string type" "matte" "rgb Kd" [0.2 0.2 0.2] TransformEnd
      MakeNamedMaterial "n" "string type" "matte" "rgb Kd" [0.3 0.3 0.3]
      NamedMaterial "m" Shape "sphere"
    {block}End
    {'ObjectInstance "o"' if name else ""}
    NamedMaterial "m" Shape "sphere"
    NamedMaterial "n" Shape "sphere"
    """
    scene, lost = pbrt(tmp_path, body)
    assert reflectances(scene) == [(0.2,) * 3, (0.1,) * 3, (0.5,) * 3]
    assert len(lost) == 1 and "material 'n', which is not defined: grey, matte" in lost[0]
    assert list(scene.materials) == ["m"]


def test_textures_of_numbers_and_colours_have_tables_of_their_own() -> None:
    scene, lost = case("same-name-for-float-and-colour-texture")
    (found,) = (one.material for one in scene.instances)
    assert isinstance(found, Bumped) and isinstance(found.base, Matte) and not lost
    assert isinstance(found.base.reflectance, CheckerboardTexture)
    assert found.height == ConstantTexture((0.25, 0.25, 0.25))


def test_a_texture_of_the_other_kind_is_none(tmp_path: Path) -> None:
    body = 'Texture "t" "float" "constant" "float value" 0.9\nMaterial "matte" "texture Kd" "t"\nShape "sphere"\n'
    scene, lost = pbrt(tmp_path, body)
    assert reflectances(scene) == [(0.5,) * 3] and "texture 't' of type color, which is not defined" in lost[0]


def test_parameters_behind_an_include_are_those_of_its_last_directive(tmp_path: Path) -> None:
    scene, lost = case("parameters-after-include")
    assert scene.instances[0].material == Matte(ConstantTexture((0.1, 0.6, 0.2)), 20.0) and not lost
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "a.pbrt").write_text('Include "b.pbrt"\n')  # beside the file that names it
    (tmp_path / "deep" / "b.pbrt").write_text('AttributeBegin Material "matte"')
    body = 'Include "deep/a.pbrt" "rgb Kd" [0.1 0.2 0.3]\nShape "sphere"\nAttributeEnd\nShape "sphere" "float radius" x'
    with pytest.raises(SceneError, match=r"a\.pbrt:7:1: Shape: expected a value for 'radius'"):
        pbrt(tmp_path, body)
    scene, _ = pbrt(tmp_path, body.removesuffix(' "float radius" x'))
    assert reflectances(scene) == [(0.1, 0.2, 0.3), (0.5, 0.5, 0.5)]


def test_materials_that_nothing_defines_are_grey_and_said_so(tmp_path: Path) -> None:
    scene, lost = case("undefined-named-material")
    first, both = (one.material for one in scene.instances)
    assert first == Matte(ConstantTexture((0.5,) * 3)) and isinstance(both, MixMaterial)
    assert [loss.split(": ", 1)[1] for loss in lost] == ["material 'gone', which is not defined: grey, matte"] * 2
    scene, lost = mitsuba(tmp_path, '<shape type="sphere"><ref id="gone"/></shape>')
    assert reflectances(scene) == [(0.5,) * 3] and "'gone', which no earlier element has as its name: grey" in lost[0]
    body = '<shape type="sphere"><bsdf type="diffuse"><ref id="gone" name="reflectance"/></bsdf></shape>'
    assert reflectances(mitsuba(tmp_path, body)[0]) == [(0.5,) * 3]


MISSING = [
    (pbrt, 'Texture "t" "color" "imagemap" "string filename" "no.png"\nMaterial "matte" "texture Kd" "t"\n'
     'Shape "sphere"', "the picture 'no.png', which is missing: the constant 0.5"),
    (pbrt, 'Shape "sphere"\nShape "plymesh" "string filename" "no.ply"', "the mesh 'no.ply', which is missing: left"),
    (pbrt, 'LightSource "infinite" "string mapname" "no.exr"\nShape "sphere"', "the picture 'no.exr', which is"),
    (pbrt, 'Material "matte" "spectrum Kd" "no.spd"\nShape "sphere"', "the spectrum 'no.spd', which is missing"),
    (mitsuba, '<shape type="sphere"><bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string '
     'name="filename" value="no.png"/></texture></bsdf></shape>', "the picture 'no.png', which is missing"),
    (mitsuba, '<shape type="sphere"/><shape type="ply"><string name="filename" value="no.ply"/></shape>',
     "the mesh 'no.ply', which is missing: left out"),
    (mitsuba, '<shape type="sphere"/><emitter type="envmap"><string name="filename" value="no.exr"/></emitter>',
     "the picture 'no.exr', which is missing: even light"),
    (mitsuba, '<shape type="sphere"><bsdf type="diffuse"><spectrum name="reflectance" filename="no.spd"/></bsdf>'
     "</shape>", "the spectrum 'no.spd', which is missing: the constant 0.5"),
]  # fmt: skip


@pytest.mark.parametrize(("read", "body", "loss"), MISSING, ids=[row[2] for row in MISSING])
def test_what_is_missing_is_a_loss_and_the_rest_is_read(read, body: str, loss: str, tmp_path: Path) -> None:
    scene, lost = read(tmp_path, body)
    assert len(scene.instances) == 1 and len(lost) == 1 and loss in lost[0]
    assert reflectances(scene) == [(0.5,) * 3]
    report = LossReport()
    scene = load_scene_file(next(tmp_path.glob("a.*")), None, report)
    with pytest.raises(SceneError, match="expected a conversion without losses"):
        save_scene_file(scene, tmp_path / "b.pbrt", None, report, strict=True)


def test_spectra_of_files_are_read(tmp_path: Path) -> None:
    (tmp_path / "s.spd").write_text("# nm value\n400 0.25\n700 0.25\n")
    body = '<shape type="sphere"><bsdf type="diffuse"><spectrum name="reflectance" filename="s.spd"/></bsdf></shape>'
    scene, lost = mitsuba(tmp_path, body)
    assert np.mean(reflectances(scene)) == pytest.approx(0.25, rel=0.05) and not lost


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_texts_in_other_encodings_are_read(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "a.pbrt").write_bytes(f'# Möbel\n{HEAD}Shape "sphere"\n'.encode(encoding))
    text = '<scene version="0.5.0"><!-- Möbel --><sensor type="perspective"/><shape type="sphere"/></scene>'
    (tmp_path / "a.xml").write_bytes(text.encode(encoding))
    for name in ("a.pbrt", "a.xml"):
        assert len(load_scene_file(tmp_path / name).instances) == 1


# --- cameras ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("file", "fov"), [("scene.xml", 30.0), ("larger.xml", 2.0 * math.degrees(
    math.atan(math.tan(math.radians(15.0)) / 2.0)))])  # fmt: skip
def test_fields_of_view_of_upright_pictures(file: str, fov: float, tmp_path: Path) -> None:
    scene, _ = case("portrait-fov", file)
    assert isinstance(scene.camera, PerspectiveCamera) and scene.camera.fov_deg == pytest.approx(fov, abs=1e-9)
    save_scene_file(scene, tmp_path / "a.pbrt")
    written = (tmp_path / "a.pbrt").read_text().split('"float fov" [ ')[1].split()[0]
    assert float(written) == pytest.approx(fov, abs=1e-6)


def test_a_picture_off_the_axis_stays_where_it_is(tmp_path: Path) -> None:
    """A ball on the axis, a quarter of the width left of the middle, in both renderers and upwards as well."""
    scene, lost = case("lens-shift")
    assert isinstance(scene.camera, PerspectiveCamera) and scene.camera.shift == (0.25, 0.0) and not lost
    text = (CASES / "lens-shift" / "scene.pbrt").read_text().replace("[-0.5 1.5 -1 1]", "[-0.5 1.5 -0.5 1.5]")
    (tmp_path / "b.pbrt").write_text(text)
    scene = load_scene_file(tmp_path / "b.pbrt")
    for program in ("mitsuba", "luxcore"):
        dark = 1.0 - drawn(scene, program, tmp_path, 64, 4).mean(axis=-1)
        at = np.arange(64) + 0.5
        found = (dark * at).sum() / dark.sum(), (dark * at[:, None]).sum() / dark.sum()
        assert found == pytest.approx((16.0, 48.0), abs=0.15)
    for ending in (".pbrt", ".lxs"):
        save_scene_file(scene, tmp_path / f"c{ending}")
        assert difference(scene.camera, load_scene_file(tmp_path / f"c{ending}").camera) is None
    report = LossReport()
    save_scene_file(scene, tmp_path / "c.xml", "mitsuba", report)
    assert any("a picture off the viewing direction" in loss.what for loss in report.losses)


@pytest.mark.parametrize(("window", "shift"), [("[0.5 -1.5 -1 1]", (0.25, 0.0)), ("[-1 1 2 0]", (0.0, -0.5))])
def test_mirrored_windows_are_shifted_in_their_own_directions(window: str, shift, tmp_path: Path) -> None:
    head = HEAD.replace('"perspective"', f'"perspective" "float screenwindow" {window}')
    scene, _ = pbrt(tmp_path, "", head)
    assert isinstance(scene.camera, PerspectiveCamera) and scene.camera.shift == shift
    save_scene_file(scene, tmp_path / "b.lxs")
    assert difference(scene.camera, load_scene_file(tmp_path / "b.lxs").camera) is None
    (tmp_path / "o").mkdir()
    scene, _ = pbrt(tmp_path / "o", "", head.replace("perspective", "orthographic"))
    assert isinstance(scene.camera, OrthographicCamera)
    assert np.abs(scene.camera.to_world[:2, 3]).max() == pytest.approx(0.5 if shift[0] else 1.0)


@pytest.mark.parametrize("text", ["", '<sensor type="fisheye"/>'])
def test_a_scene_without_a_camera_that_is_known_is_seen(text: str, tmp_path: Path) -> None:
    scene, lost = mitsuba(tmp_path, '<shape type="sphere"/><strange/>', text)
    assert isinstance(scene.camera, PerspectiveCamera) and len(lost) == 2
    assert "element 'strange', which is not known" in lost[0 if not text else 1]
    if not text:
        assert scene.camera.to_world[:3, 3] == pytest.approx((0.0, 0.0, -1.0 - 1.0 / math.tan(math.radians(22.5))))
    scene, lost = pbrt(tmp_path, 'Shape "sphere"', "WorldBegin\n")
    assert isinstance(scene.camera, PerspectiveCamera) and "no camera" in lost[0]


# --- texts -----------------------------------------------------------------------------------------------------------


def test_parameters_inside_values_are_filled_in(tmp_path: Path) -> None:
    scene, lost = case("parameter-inside-a-value", "scene.xml")
    assert isinstance(scene.instances[0].shape, Rectangle) and reflectances(scene) == [(0.25, 0.5, 0.75)] and not lost
    assert (scene.film.width_px, scene.film.height_px) == (32, 32)
    film = case("parameter-inside-a-value", "longer.xml")[0].film
    assert (film.width_px, film.height_px) == (48, 16)
    body = '<default name="a" value="' + "$b" * 1000 + '"/><default name="b" value="' + "x" * 1000 + '"/>'
    with pytest.raises(SceneError, match="expected at most 65,536 characters with parameters"):
        mitsuba(tmp_path, body + '<bsdf type="$a"/>')


# --- nothing is lost in silence --------------------------------------------------------------------------------------

SILENT = [
    ('<shape type="sphere"><bsdf type="diffuse"><texture type="checkerboard" name="reflectence"/></bsdf></shape>',
     "diffuse: texture 'reflectence': left out"),
    ('<shape type="rectangle"><emitter type="area"><texture type="checkerboard" name="radiance"/></emitter></shape>',
     "a lamp with a texture: its mean"),
    ('<shape type="sphere"><bsdf type="diffuse" name="a"/><bsdf type="plastic" name="b"/></shape>',
     "several materials for one mesh: the last"),
    ('<shape type="sphere"><bsdf type="roughplastic"><float name="alphaU" value="0.1"/>'
     '<float name="alphaV" value="0.4"/></bsdf></shape>', "a coat of two roughnesses: one of alpha 0.2"),
    ('<shape type="sphere"><bsdf type="roughdiffuse"><texture type="checkerboard" name="alpha"/></bsdf></shape>',
     "alpha: a texture: its mean, 0.3"),
    ('<integrator type="path"><integrator type="direct"/></integrator>', "integrator 'direct' inside an integrator"),
    ('<sensor type="perspective"/>', "another sensor: the last one"),
    ('<film type="ldrfilm"><float name="exposure" value="2"/></film>', "exposure of the film: linear radiance"),
    ('<sensor type="perspective"><float name="nearClip" value="3"/></sensor>',
     "nearClip of the sensor: nothing is cut"),
]  # fmt: skip


@pytest.mark.parametrize(("body", "loss"), SILENT, ids=[row[1] for row in SILENT])
def test_what_cannot_be_kept_is_said(body: str, loss: str, tmp_path: Path) -> None:
    _, lost = mitsuba(tmp_path, body)
    assert any(loss in one for one in lost)


def test_holes_of_each_colour_are_a_loss_in_pbrt(tmp_path: Path) -> None:
    opacity = '<rgb name="opacity" value="0.2 0.5 0.8"/>'
    body = f'<shape type="rectangle"><bsdf type="mask">{opacity}<bsdf type="diffuse"/></bsdf></shape>'
    report = LossReport()
    save_scene_file(mitsuba(tmp_path, body)[0], tmp_path / "b.pbrt", None, report)
    assert "an opacity for each colour" in report.text()


@pytest.mark.parametrize(("kind", "value"), [("constant", 0.2), ("checkerboard", 0.3)])
def test_roughness_by_a_texture_is_a_number_where_it_is_even_and_kept_elsewhere(
    kind: str, value: float, tmp_path: Path
) -> None:
    """The renderer uses the mean of the other one, 0.3."""
    found = []
    for version in (3, 4):
        values = '"float value" 0.2' if kind == "constant" else '"float tex1" 0.2 "float tex2" 0.4'
        metal = "metal" if version == 3 else "conductor"
        body = f'Texture "r" "float" "{kind}" {values}\nMaterial "{metal}" "texture roughness" "r" '
        body += '"bool remaproughness" "false"\nShape "sphere"\n'
        head = HEAD if version == 3 else f'Film "rgb"\n{HEAD}'
        found.append(pbrt(tmp_path, body, head))
    if kind == "checkerboard":  # Mitsuba's own is 0.4 and 0.2
        inside = f'<texture type="{kind}" name="alpha"/>'
        found.append(mitsuba(tmp_path, f'<shape type="sphere"><bsdf type="roughconductor">{inside}</bsdf></shape>'))
    for scene, lost in found:
        (one,) = scene.instances
        assert isinstance(one.material, Metal) and one.material.roughness == pytest.approx((value, value))
        assert not any("its mean" in line for line in lost)
        assert isinstance(one.material.alpha, CheckerboardTexture) == (kind == "checkerboard")
