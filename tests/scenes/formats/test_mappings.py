"""Replacements for features that a format lacks: they emit, reflect and look the same."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from analysis.conversion.peers import rendered
from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    Cube,
    Disk,
    EnvironmentLight,
    Glossy,
    ImageTexture,
    Instance,
    Integrator,
    Masked,
    Material,
    Matte,
    Metal,
    Mirror,
    MixMaterial,
    MixTexture,
    PerspectiveCamera,
    Rectangle,
    ScaleTexture,
    Scene,
    SceneError,
    Sphere,
    SpotLight,
)
from scenes.formats.appearance.folding import folded
from scenes.formats.appearance.spectra import METALS
from scenes.formats.appearance.spot_profiles import flux, reshaped
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.geometry.orientation import FLIPPED
from scenes.formats.geometry.ply_files import read_ply
from scenes.formats.geometry.revolution import area, lamp_sphere
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.write_materials import BLUNT

RED, HALF = ConstantTexture((0.6, 0.1, 0.1)), ConstantTexture((0.5, 0.5, 0.5))
CHECKS = CheckerboardTexture(ConstantTexture((0.2, 0.2, 0.2)), ConstantTexture((1.0, 1.0, 1.0)), (4.0, 2.0))


def through(material: Material, path: Path) -> tuple[Material, list[str], str]:
    """A rectangle's material written and read again, what was lost, and the text."""
    report = LossReport()
    save_scene_file(Scene(PerspectiveCamera(), (Instance(Rectangle(), material),)), path, None, report)
    (found,) = load_scene_file(path).instances
    return found.material, [str(loss) for loss in report.losses if "material" in str(loss)], path.read_text()


@pytest.mark.parametrize("opacity", [HALF, CHECKS], ids=["even", "checks"])
def test_holes_come_back_from_luxrender(opacity, tmp_path: Path) -> None:
    """As a mixture with a surface that is not there."""
    material = Masked(Matte(RED), opacity)
    found, lost, text = through(material, tmp_path / "a.lxs")
    assert '"null"' in text and ["holes or panes" in loss for loss in lost] == [True]  # in LuxCore
    assert difference(material, found) is None


def test_pbrt_has_textures_of_numbers_for_holes(tmp_path: Path) -> None:
    found, _, text = through(Masked(Matte(RED), CHECKS), tmp_path / "a.pbrt")
    assert '"float" "checkerboard" "float tex1"' in text and isinstance(found, Masked)
    assert difference(found.opacity, CHECKS) is None


@pytest.mark.parametrize(("ending", "scale"), [(".pbrt", (0.3, 0.2, 0.1)), (".pbrt", (0.3,) * 3), (".lxs", (0.3,) * 3)])
def test_a_dimmed_metal_comes_back(ending: str, scale, tmp_path: Path) -> None:
    material = Metal(*METALS["Au"], (0.1, 0.1), ConstantTexture(scale))
    found, lost, text = through(material, tmp_path / f"a{ending}")
    assert '"mix"' in text and not lost and difference(material, found) is None


def test_a_metal_that_is_tinted_is_its_colour_in_luxrender(tmp_path: Path) -> None:
    _, lost, _ = through(Metal(*METALS["Au"], (0.1, 0.1), ConstantTexture((0.3, 0.2, 0.1))), tmp_path / "a.lxs")
    assert any("the complex index of a metal" in loss for loss in lost)


def numeric_flux(light: SpotLight) -> float:
    """Power over 2π by its definition."""
    theta = (np.arange(200_000) + 0.5) * math.radians(light.outer_deg) / 200_000
    inner, outer = math.radians(light.inner_deg), math.radians(light.outer_deg)
    x = np.clip((np.cos(theta) - math.cos(outer)) / (math.cos(inner) - math.cos(outer)), 0.0, 1.0)
    if light.profile == "linear":
        x = np.clip((outer - theta) / (outer - inner), 0.0, 1.0)
    shape = {"hermite": x * x * (3.0 - 2.0 * x), "quartic": x**4, "linear": x, "secant": x**4 / np.cos(theta)}[
        light.profile
    ]
    return light.intensity[0] * float((shape * np.sin(theta)).sum() * outer / 200_000)


@pytest.mark.parametrize("wanted", ["hermite", "quartic", "linear", "secant"])
@pytest.mark.parametrize("given", ["hermite", "quartic", "linear", "secant"])
@pytest.mark.parametrize("angles", [(15.0, 20.0), (0.0, 40.0), (25.0, 85.0), (0.0, 5.0)])
def test_spots_keep_their_power(given: str, wanted: str, angles) -> None:
    light = SpotLight((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (2.0, 2.0, 2.0), *angles, given)  # type: ignore[arg-type]
    assert 2.0 * flux(given, *angles) == pytest.approx(numeric_flux(light), rel=1e-4)
    report = LossReport()
    made = reshaped(light, wanted, report)
    assert made.profile == wanted and 0.0 <= made.inner_deg <= made.outer_deg == light.outer_deg
    assert numeric_flux(made) == pytest.approx(numeric_flux(light), rel=1e-4)
    assert len(report.losses) == (given != wanted)


def test_the_renderer_draws_its_own_profile_only() -> None:
    from renderer.trace import Renderer

    light = SpotLight((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 10.0, 20.0, "linear")
    with pytest.raises(SceneError, match=r"SpotLight\.profile: expected hermite"):
        Renderer(Scene(PerspectiveCamera(), (Instance(Rectangle(), Matte(RED)),), (light,)))


def image(seed: int) -> ImageTexture:
    return ImageTexture(np.random.default_rng(seed).random((4, 8, 3), np.float32), (2.0, 3.0))


def test_textures_fold() -> None:
    first, second = image(1), image(2)
    for texture, expected in (
        (ScaleTexture(first, RED), first.image * np.float32(RED.value)),
        (ScaleTexture(first, second), first.image * second.image),
        (MixTexture(RED, first, 0.25), 0.75 * np.float32(RED.value) + 0.25 * first.image),
    ):
        made = folded(texture)
        assert isinstance(made, ImageTexture) and made.uv_scale == first.uv_scale
        np.testing.assert_allclose(made.image, expected, rtol=1e-6)
    checks = folded(ScaleTexture(ScaleTexture(CHECKS, HALF), RED))
    assert isinstance(checks, CheckerboardTexture) and isinstance(checks.odd, ConstantTexture)
    np.testing.assert_allclose(checks.odd.value, 0.5 * np.array(RED.value))
    assert folded(ScaleTexture(RED, HALF)) == ConstantTexture((0.3, 0.05, 0.05))


def test_textures_that_do_not_fold_stay() -> None:
    other = ImageTexture(image(3).image, (1.0, 1.0))
    for texture in (ScaleTexture(image(1), other), ScaleTexture(CHECKS, image(1))):
        assert folded(texture) is texture
    black_outside = ImageTexture(image(1).image, wrap="black")
    mixed = MixTexture(black_outside, RED, 0.5)
    assert folded(mixed) is mixed  # outside it is the constant's share, not black


def test_a_lamp_has_the_area_of_the_sphere_and_few_triangles(tmp_path: Path) -> None:
    mesh = lamp_sphere()
    assert len(mesh.faces) <= 256 and area(mesh) == pytest.approx(4.0 * math.pi, rel=1e-5)
    corners = mesh.vertices[mesh.faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((outward * corners.mean(axis=1)).sum(axis=1) > 0.0).all()
    lamp = Instance(Sphere(0.7), Matte(RED), emission=(1.0, 2.0, 3.0))
    scene = Scene(PerspectiveCamera(), (lamp, dataclasses.replace(lamp, emission=None)))
    save_scene_file(scene, tmp_path / "a.lxs")
    shining, plain = load_scene_file(tmp_path / "a.lxs").instances
    assert len(shining.shape.faces) == 224  # type: ignore[union-attr]
    assert isinstance(plain.shape, Sphere)
    np.testing.assert_allclose(plain.shape.radius * plain.to_world[:3, :3], 0.7 * np.eye(3), atol=1e-6)


def test_pictures_that_pbrt_cannot_read_are_written_anew(tmp_path: Path) -> None:
    from PIL import Image

    from scenes.loading import read_image

    Image.fromarray(np.full((4, 4, 3), 200, np.uint8)).save(tmp_path / "a.jpg")
    texture = ImageTexture(read_image(tmp_path / "a.jpg"), source=str(tmp_path / "a.jpg"))
    for ending, kept in ((".pbrt", ".exr"), (".xml", ".jpg"), (".lxs", ".exr")):
        found, _, text = through(Matte(texture), tmp_path / ending[1:] / f"b{ending}")
        assert kept in text and isinstance(found, Matte) and isinstance(found.reflectance, ImageTexture)
        np.testing.assert_allclose(found.reflectance.image, texture.image, rtol=1e-3)


def seen_by_mitsuba(kind: str, points: np.ndarray, outward: np.ndarray) -> np.ndarray:
    """Texture coordinates of points on one of Mitsuba's shapes."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    shape = mi.load_dict({"type": "scene", "shape": {"type": kind}})
    found = []
    for point, away in zip(points, outward, strict=True):
        ray = mi.Ray3f((point + away).tolist(), (-away).tolist())
        found.append(np.array(shape.ray_intersect(ray).uv).ravel())
    return np.array(found)


@pytest.mark.parametrize("kind", ["rectangle", "cube", "disk", "sphere"])
def test_textures_lie_as_on_the_shapes_of_mitsuba(kind: str, tmp_path: Path) -> None:
    """In the middle of triangles of what the importer makes of a textured shape."""
    text = (
        f'<scene version="0.5.0"><sensor type="perspective"/><shape type="{kind}"><bsdf type="diffuse">'
        '<texture type="checkerboard" name="reflectance"/></bsdf></shape></scene>'
    )
    (tmp_path / "a.xml").write_text(text)
    (made,) = load_scene_file(tmp_path / "a.xml").instances
    mesh = as_mesh(made.shape)
    assert mesh.uvs is not None and mesh.normals is not None
    faces = mesh.faces[:: max(1, len(mesh.faces) // 60)]
    points = mesh.vertices[faces].mean(axis=1) @ made.to_world[:3, :3].T
    outward = mesh.normals[faces].mean(axis=1) @ np.linalg.inv(made.to_world[:3, :3])
    ours = mesh.uvs[faces].mean(axis=1)
    apart = np.abs(seen_by_mitsuba(kind, points, outward / np.linalg.norm(outward, axis=1, keepdims=True)) - ours)
    # the triangles of a sphere are flat, and those at the middle of a disk and at poles wide
    assert np.median(apart) < 3e-3 and np.quantile(apart, 0.9) < 0.02
    exact = kind in ("rectangle", "cube")
    assert apart.max() < (1e-5 if exact else 0.1)


@pytest.mark.parametrize("shape", [Sphere(), Disk(), Cube()], ids=["sphere", "disk", "cube"])
def test_textured_shapes_for_mitsuba_keep_where_textures_lie(shape, tmp_path: Path) -> None:
    """As meshes with the canonical coordinates; a sphere of Mitsuba's own comes back as one."""
    scene = Scene(PerspectiveCamera(), (Instance(shape, Matte(CHECKS)),))
    save_scene_file(scene, tmp_path / "a.xml")
    assert 'type="ply"' in (tmp_path / "a.xml").read_text()
    (found,) = load_scene_file(tmp_path / "a.xml").instances
    assert type(found.shape) is type(shape)  # recognised by its coordinates
    np.testing.assert_allclose(found.to_world, np.eye(4), atol=1e-5)
    turned = Scene(PerspectiveCamera(), (Instance(Sphere(), Matte(CHECKS), FLIPPED),))
    save_scene_file(turned, tmp_path / "b.xml")
    text = (tmp_path / "b.xml").read_text()
    assert 'type="sphere"' in text and "toWorld" not in text.split("<shape")[1]


def test_a_stretched_sphere_is_triangles_for_mitsuba(tmp_path: Path) -> None:
    scene = Scene(PerspectiveCamera(), (Instance(Sphere(), Matte(RED), np.diag([1.0, 2.0, 1.0, 1.0])),))
    report = LossReport()
    save_scene_file(scene, tmp_path / "a.xml", None, report)
    assert 'type="ply"' in (tmp_path / "a.xml").read_text() and "a stretched sphere" in report.text()


def test_a_mirrored_textured_sphere_is_a_mesh_with_its_outside_out_for_luxrender(tmp_path: Path) -> None:
    scene = Scene(PerspectiveCamera(), (Instance(Sphere(), Matte(CHECKS), FLIPPED),))
    save_scene_file(scene, tmp_path / "a.lxs")
    (file,) = (tmp_path / "models").iterdir()
    mesh = read_ply(file.read_bytes(), "sphere", LossReport())
    corners = mesh.vertices[mesh.faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((outward * corners.mean(axis=1)).sum(axis=1) > 0.0).all()
    top = mesh.uvs[mesh.vertices[:, 2] > 0.999]  # type: ignore[index]
    assert (top[:, 1] < 0.02).all()  # where an unturned sphere has v = 1
    (found,) = load_scene_file(tmp_path / "a.lxs").instances
    assert isinstance(found.shape, Sphere)
    np.testing.assert_allclose(found.to_world, FLIPPED, atol=1e-5)


@pytest.mark.parametrize(("ending", "written"), [(".pbrt", "[ 4 ]"), (".lxs", "[ 5 ]"), (".xml", 'value="5"')])
def test_depths_count_bounces_or_edges(ending: str, written: str, tmp_path: Path) -> None:
    """PBRT counts bounces; Mitsuba and, as measured, LuxCore count the edges of a path, one more."""
    save_scene_file(Scene(PerspectiveCamera(), (), integrator=Integrator("path", 4)), tmp_path / f"a{ending}")
    line = next(line for line in (tmp_path / f"a{ending}").read_text().splitlines() if "maxdepth" in line.lower())
    assert written in line and load_scene_file(tmp_path / f"a{ending}").integrator.depth == 4


def modern(material: Material, path: Path) -> tuple[str, str]:
    """A material as written for Mitsuba 3, and what was lost."""
    report = LossReport()
    save_scene_file(Scene(PerspectiveCamera(), (Instance(Rectangle(), material),)), path, "mitsuba3", report)
    return path.read_text(), report.text()


def test_mirrors_in_mixtures_are_blunt_for_mitsuba_3(tmp_path: Path) -> None:
    """Its blend of a sharp one loses light; as written, half of each colour comes back from an even white sky."""
    mixed = MixMaterial(Mirror(RED), Matte(RED), HALF)
    text, lost = modern(mixed, tmp_path / "a.xml")
    assert 'type="roughconductor"' in text and f"alpha {BLUNT:g}" in lost and 'name="weight" value="0.5"' in text
    pytest.importorskip("mitsuba")
    view, sky = np.eye(4), EnvironmentLight(np.ones((1, 1, 3), np.float32))
    view[2, 3] = 5.0
    bright = MixMaterial(Mirror(ConstantTexture((0.85,) * 3)), Matte(HALF), HALF)
    scene = Scene(PerspectiveCamera(view, 10.0), (Instance(Rectangle(), bright),), (sky,))
    save_scene_file(scene, tmp_path / "c.xml", "mitsuba3")
    picture = rendered("mitsuba", tmp_path / "c.xml", tmp_path / "c.npy", (16, 16), 256, 120.0)
    assert not isinstance(picture, str), picture
    np.testing.assert_allclose(picture.mean(), 0.5 * 0.85 + 0.5 * 0.5, rtol=0.01)
    alone, lost = modern(Mirror(RED), tmp_path / "b.xml")
    assert 'type="conductor"' in alone and "alpha" not in lost


@pytest.mark.parametrize(("specular", "index"), [(0.04, 1.5), (0.06, 1.6488), (0.25, 3.0)])
def test_a_coat_has_the_index_that_reflects_as_much(specular: float, index: float, tmp_path: Path) -> None:
    coat = ConstantTexture((specular, 0.5 * specular, specular))
    text, _ = modern(Glossy(RED, coat, (0.1, 0.1)), tmp_path / "a.xml")
    found = float(text.split('name="int_ior" value="')[1].split('"')[0])
    assert found == pytest.approx(index, abs=1e-3)
    assert ((found - 1.0) / (found + 1.0)) ** 2 == pytest.approx(specular, rel=1e-4)
    assert 'name="specular_reflectance" value="1, 0.5, 1"' in text
