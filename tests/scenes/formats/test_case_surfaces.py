"""Surfaces of small scenes that users of converters reported; the sources are in ``cases/README.md``."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    Bumped,
    CheckerboardTexture,
    ConstantTexture,
    ImageTexture,
    Masked,
    Matte,
    Mesh,
    PerspectiveCamera,
    Rectangle,
    Sphere,
)
from scenes.formats.appearance.folding import height_of
from scenes.formats.appearance.mixtures import is_nothing
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import CASES, HEAD, case, drawn, mitsuba, pbrt, reflectances, seen

# --- surfaces --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("file", ["obj.xml", "ply.xml", "rectangle.xml"])
def test_textures_are_upright_on_meshes_and_rectangles(file: str, tmp_path: Path) -> None:
    """Beside what Mitsuba 3 draws of the same file; it reads triangles only."""
    shutil.copytree(CASES / "texture-upright-on-ply-obj-rectangle", tmp_path, dirs_exist_ok=True)
    scene = load_scene_file(tmp_path / file)
    text = (tmp_path / "q.ply").read_text()
    (tmp_path / "q.ply").write_text(text.replace("face 1", "face 2").replace("4 0 1 2 3", "3 0 1 2\n3 0 2 3"))
    wanted = seen("mitsuba", tmp_path / file, 32, 4)
    for program in ("mitsuba", "luxcore"):
        found = drawn(scene, program, tmp_path / program)
        for x, y in ((10, 10), (21, 10), (10, 21), (21, 21)):
            assert ((found[y, x] > 0.5) == (wanted[y, x] > 0.5)).all()
    assert len({tuple(np.round(wanted[y, x]).tolist()) for x in (10, 21) for y in (10, 21)}) == 4


@pytest.mark.parametrize(("name", "file", "hint"), [
    ("null-border-of-a-medium", "scene.pbrt", "media, which the integrator 'path' does not draw"),
    ("null-border-of-a-medium", "scene.xml", "the border of a medium, which is invisible")])  # fmt: skip
def test_borders_of_media_are_not_seen(name: str, file: str, hint: str) -> None:
    scene, lost = case(name, file)
    assert reflectances(scene) == [(0.9, 0.1, 0.1)] and scene.instances[0].shape == Sphere(0.6)
    assert sum(hint in loss for loss in lost) == 1


def test_a_shape_of_mitsuba_0_5_with_a_medium_alone_is_its_border() -> None:
    scene, lost = case("one-sided-and-medium-defaults", "medium.xml")
    border, ball = scene.instances
    assert not lost
    assert is_nothing(border.material) and border.interior is not None
    assert sum(border.interior.extinction) == pytest.approx(0.03) and ball.shape == Sphere(0.6)


def test_a_border_that_shines_is_kept(tmp_path: Path) -> None:
    scene, _ = pbrt(tmp_path, 'Material ""\nAreaLightSource "diffuse"\nShape "sphere"\n')
    assert isinstance(scene.instances[0].material, Masked) and scene.instances[0].emission == (1.0, 1.0, 1.0)


def test_what_has_one_side_is_black_behind(tmp_path: Path) -> None:
    """Also as written again for Mitsuba; PBRT and LuxRender have no such surfaces, which is a loss."""
    scene, lost = case("one-sided-and-medium-defaults", "one-sided.xml")
    assert scene.instances[0].one_sided and not lost
    picture = drawn(scene, "mitsuba", tmp_path)
    assert (picture == 0.0).all()
    save_scene_file(scene, tmp_path / "b.xml")
    assert difference(scene.instances, load_scene_file(tmp_path / "b.xml").instances) is None
    for ending in (".pbrt", ".lxs"):
        report = LossReport()
        save_scene_file(scene, tmp_path / f"c{ending}", None, report)
        assert any(loss.what == "a surface with a black back" for loss in report.losses)


ONE_SIDED = [
    ('<bsdf type="diffuse"/>', True),
    ("", True),
    ('<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>', False),
    ('<bsdf type="dielectric"/>', False),
    ('<bsdf type="mask"><bsdf type="plastic"/></bsdf>', True),
    ('<bsdf type="blendbsdf"><bsdf type="diffuse"/><bsdf type="roughconductor"/></bsdf>', True),
    ('<bsdf type="blendbsdf"><bsdf type="diffuse"/><bsdf type="dielectric"/></bsdf>', False),
]


@pytest.mark.parametrize(("bsdf", "expected"), ONE_SIDED)
def test_which_materials_have_one_side(bsdf: str, expected: bool, tmp_path: Path) -> None:
    scene, _ = mitsuba(tmp_path, f'<shape type="rectangle">{bsdf}</shape>')
    assert scene.instances[0].one_sided == expected
    save_scene_file(scene, tmp_path / "b.xml")
    assert difference(scene.instances, load_scene_file(tmp_path / "b.xml").instances) is None


def test_backs_inside_closed_shapes_are_no_loss(tmp_path: Path) -> None:
    from scenes.formats.geometry.meshed import mitsuba_cube
    from scenes.formats.geometry.orientation import is_closed, turned

    cube = mitsuba_cube()
    assert is_closed(cube) and not is_closed(turned(cube)) and is_closed(Sphere()) and not is_closed(Rectangle())
    assert not is_closed(Mesh(cube.vertices, cube.faces[1:]))


# --- LuxRender -------------------------------------------------------------------------------------------------------


def test_defaults_of_exporters_to_luxrender() -> None:
    scene, lost = case("lux-exporter-defaults", "scene.lxs")
    assert isinstance(scene.camera, PerspectiveCamera) and scene.camera.lens_radius == 0.0 and not lost
    scene, lost = case("lux-exporter-defaults", "quads.lxs")
    assert isinstance(scene.instances[0].shape, Rectangle) and not lost
    scene, lost = case("lux-exporter-defaults", "both.lxs")
    mesh = scene.instances[0].shape
    assert isinstance(mesh, Mesh) and mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]] and not lost
    scene, lost = case("lux-exporter-defaults", "bump.lxs")
    assert isinstance(scene.instances[0].material, Bumped) and not lost
    assert isinstance(scene.instances[0].material.height, CheckerboardTexture)
    _, lost = case("lux-exporter-defaults", "cauchy.lxs")
    assert "dispersion (cauchyb): one index for all colours" in lost[-1]


@pytest.mark.parametrize("kind", ["matte", "glossy", "metal", "mirror", "carpaint", "glass"])
def test_every_material_of_luxrender_takes_bumps(kind: str, tmp_path: Path) -> None:
    body = f'Texture "h" "float" "checkerboard"\nMaterial "{kind}" "texture bumpmap" "h"\nShape "sphere"\n'
    (tmp_path / "a.lxs").write_text(HEAD + body)
    assert isinstance(load_scene_file(tmp_path / "a.lxs").instances[0].material, Bumped)


def test_a_lens_in_focus_at_zero_is_a_pinhole_and_said_so(tmp_path: Path) -> None:
    head = HEAD.replace('"perspective"', '"perspective" "float lensradius" 0.1 "float focaldistance" 0')
    scene, lost = pbrt(tmp_path, "", head)
    assert isinstance(scene.camera, PerspectiveCamera) and scene.camera.lens_radius == 0.0
    assert "a lens in focus at 0: a pinhole" in lost[0]


# --- bumps -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("picture", "toward"), [("hill.exr", (-1.0, 0.0)), ("y.exr", (0.0, -1.0))])
def test_hills_are_hills_in_every_renderer(picture: str, toward, tmp_path: Path) -> None:
    """Lit from the right or from above, that side is the brighter one, as much as in Mitsuba 3's own scene.

    LuxCore's lit side is 11 % darker: it weighs light by the angles to the surface as well.
    """
    shutil.copytree(CASES / "bump-sign", tmp_path, dirs_exist_ok=True)
    for name, old, new in (
        ("m3.xml", 'x="-1" y="0"', f'x="{toward[0]}" y="{toward[1]}"'),
        ("scene.pbrt", '"point to" [-1 0 -0.6]', f'"point to" [{toward[0]} {toward[1]} -0.6]'),
    ):
        text = (tmp_path / name).read_text().replace("hill.exr", picture).replace(old, new)
        (tmp_path / name).write_text(text)

    def sides(found: np.ndarray) -> tuple[float, float]:
        grey = found.mean(axis=-1) if toward[0] else found.mean(axis=-1)[::-1].T
        return float(grey[12:20, 7:15].mean()), float(grey[12:20, 17:25].mean())

    dark, lit = sides(seen("mitsuba", tmp_path / "m3.xml", 32, 16))
    assert lit > 4.0 * dark
    scene = load_scene_file(tmp_path / "scene.pbrt")
    assert sides(drawn(scene, "mitsuba", tmp_path / "m")) == pytest.approx((dark, lit), rel=0.01)
    found = sides(drawn(scene, "luxcore", tmp_path / "l"))
    assert found[0] == pytest.approx(dark, rel=0.05) and 0.85 < found[1] / lit < 1.0


def test_the_scale_of_bumps_is_kept(tmp_path: Path) -> None:
    image = ImageTexture(np.random.default_rng(0).random((4, 4, 3), np.float32))
    scene, _ = pbrt(tmp_path, 'Shape "sphere"')
    bumped = Bumped(Matte(ConstantTexture((0.5,) * 3)), image, 3.0)
    assert height_of(bumped) is not image
    from dataclasses import replace

    scene = replace(scene, instances=(replace(scene.instances[0], material=bumped),))
    for ending in (".pbrt", ".lxs", ".xml"):
        report = LossReport()
        save_scene_file(scene, tmp_path / f"b{ending}", None, report)
        found = load_scene_file(tmp_path / f"b{ending}").instances[0].material
        assert isinstance(found, Bumped) and "bump" not in report.text()
        from scenes.formats.appearance.folding import folded

        height = folded(height_of(found))
        assert isinstance(height, ImageTexture)
        np.testing.assert_allclose(height.image, 3.0 * image.image, rtol=1e-3)


# --- blocks ----------------------------------------------------------------------------------------------------------


def test_objects_and_attributes_may_cross(tmp_path: Path) -> None:
    """The inner block ends, whatever it is, as in PBRT."""
    body = 'AttributeBegin\nObjectBegin "o"\nShape "sphere"\nAttributeEnd\nObjectEnd\nObjectInstance "o"\n'
    scene, lost = pbrt(tmp_path, body)
    assert len(scene.instances) == 1 and "AttributeEnd inside ObjectBegin: the end of the inner block" in lost[0]
