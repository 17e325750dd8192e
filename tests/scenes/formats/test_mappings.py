"""What stands in the place of what a format does not have: it shines, reflects and looks alike."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    ImageTexture,
    Instance,
    Masked,
    Material,
    Matte,
    Metal,
    MixTexture,
    PerspectiveCamera,
    Rectangle,
    ScaleTexture,
    Scene,
    SceneError,
    Sphere,
    SpotLight,
)
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.folding import folded
from scenes.formats.losses import LossReport
from scenes.formats.revolution import area, lamp_sphere
from scenes.formats.spectra import METALS
from scenes.formats.spot_profiles import flux, reshaped

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
    assert '"null"' in text and not lost
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
    shape = {"hermite": x * x * (3.0 - 2.0 * x), "quartic": x**4, "linear": x}[light.profile]
    return light.intensity[0] * float((shape * np.sin(theta)).sum() * outer / 200_000)


@pytest.mark.parametrize("wanted", ["hermite", "quartic", "linear"])
@pytest.mark.parametrize("given", ["hermite", "quartic", "linear"])
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
    mesh = lamp_sphere(0.7)
    assert len(mesh.faces) <= 256 and area(mesh) == pytest.approx(4.0 * math.pi * 0.49, rel=1e-5)
    corners = mesh.vertices[mesh.faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((outward * corners.mean(axis=1)).sum(axis=1) > 0.0).all()
    lamp = Instance(Sphere(0.7), Matte(RED), emission=(1.0, 2.0, 3.0))
    scene = Scene(PerspectiveCamera(), (lamp, dataclasses.replace(lamp, emission=None)))
    save_scene_file(scene, tmp_path / "a.lxs")
    shining, plain = load_scene_file(tmp_path / "a.lxs").instances
    assert len(shining.shape.faces) == 224  # type: ignore[union-attr]
    assert isinstance(plain.shape, Sphere) and plain.shape.radius == pytest.approx(0.7, rel=1e-5)


def test_pictures_that_pbrt_cannot_read_are_written_anew(tmp_path: Path) -> None:
    from PIL import Image

    from scenes.loading import read_image

    Image.fromarray(np.full((4, 4, 3), 200, np.uint8)).save(tmp_path / "a.jpg")
    texture = ImageTexture(read_image(tmp_path / "a.jpg"), source=str(tmp_path / "a.jpg"))
    for ending, kept in ((".pbrt", ".exr"), (".xml", ".jpg"), (".lxs", ".exr")):
        found, _, text = through(Matte(texture), tmp_path / ending[1:] / f"b{ending}")
        assert kept in text and isinstance(found, Matte) and isinstance(found.reflectance, ImageTexture)
        np.testing.assert_allclose(found.reflectance.image, texture.image, rtol=1e-3)
