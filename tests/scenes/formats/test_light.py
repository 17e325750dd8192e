"""Brightness of converted scenes in the pictures of other renderers is that of the source."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    ConstantTexture,
    DirectionalLight,
    EnvironmentLight,
    Film,
    Instance,
    Integrator,
    Material,
    Matte,
    Mesh,
    Metal,
    MixMaterial,
    PerspectiveCamera,
    Plastic,
    PointLight,
    Rectangle,
    Scene,
    SpotLight,
    Uber,
)
from scenes.formats.appearance.indices import mean_reflectance
from scenes.formats.appearance.spectra import planck, radiant_rgb
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.write_materials import BLUNT
from tests.scenes.formats.files import CASES, HEAD, drawn, mitsuba, seen

LUX = CASES / "lux-point-and-spot-units"
ENDINGS = {"mitsuba": ".xml", "luxcore": ".lxs"}


def middle(picture: np.ndarray) -> float:
    return float(picture[15:17, 15:17].mean())


@pytest.mark.parametrize(
    ("case", "radiance"), [("a", 0.0314), ("b", 0.0314), ("c", 0.0628), ("d", 0.3957), ("e", 0.3957)]
)
def test_point_and_spot_lights_of_luxrender(case: str, radiance: float) -> None:
    """Over a floor of albedo 0.5 two units below the lamp; LuxCore's own pictures have these values there."""
    (lamp,) = load_scene_file(LUX / f"{case}.lxs").lights
    assert isinstance(lamp, PointLight | SpotLight)
    assert 0.5 / math.pi * lamp.intensity[0] / 4.0 == pytest.approx(radiance, rel=0.02)


def test_the_power_of_a_point_light_is_reported() -> None:
    report = LossReport()
    load_scene_file(LUX / "b.lxs", None, report)
    assert [loss.what for loss in report.losses] == ["the power of a point light"]


@pytest.mark.parametrize("case", ["a", "e"])
def test_lamps_of_luxrender_shine_alike_in_both_renderers(case: str, tmp_path: Path) -> None:
    scene = load_scene_file(LUX / f"{case}.lxs")
    wanted = middle(seen("luxcore", _copied(LUX / f"{case}.lxs", tmp_path), 32, 64))
    assert wanted == pytest.approx(0.0314 if case == "a" else 0.3957, rel=0.01)
    for program in ENDINGS:
        assert middle(drawn(scene, program, tmp_path / program, 32, 64)) == pytest.approx(wanted, rel=0.01)


def _copied(file: Path, folder: Path) -> Path:
    (folder / file.name).write_bytes(file.read_bytes())
    return folder / file.name


@pytest.mark.parametrize("angle_deg", [0.0, 0.53, 5.0])
def test_suns_of_luxrender_are_as_bright_whatever_their_angle(angle_deg: float, tmp_path: Path) -> None:
    light = DirectionalLight((0.0, 0.0, -1.0), (10.0, 5.0, 2.0), angle_deg)
    view = np.eye(4)
    view[2, 3] = 4.0
    floor = Instance(Rectangle(), Matte(even(0.5)), np.diag([9.0, 9.0, 1.0, 1.0]))
    scene = Scene(PerspectiveCamera(view, 40.0), (floor,), (light,), Film(32, 32), integrator=Integrator("path", 1))
    picture = drawn(scene, "luxcore", tmp_path)
    assert picture.mean(axis=(0, 1)) == pytest.approx(0.5 / math.pi * np.array(light.irradiance), rel=0.01)
    (found,) = load_scene_file(tmp_path / "a.lxs").lights
    assert isinstance(found, DirectionalLight) and found.angle_deg == pytest.approx(angle_deg)
    assert found.irradiance == pytest.approx(light.irradiance, rel=1e-6)


def test_spots_of_luxcore_are_divided_by_the_cosine(tmp_path: Path) -> None:
    """Inside the inner cone, on a floor that faces lamp and camera."""
    view = np.eye(4)
    view[2, 3] = 4.0
    floor = Instance(Rectangle(), Matte(even(0.5)), np.diag([9.0, 9.0, 1.0, 1.0]))
    spot = SpotLight((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (10.0,) * 3, 44.0, 45.0, "secant")
    film, once = Film(64, 64), Integrator("path", 1)
    picture = drawn(
        Scene(PerspectiveCamera(view, 40.0), (floor,), (spot,), film, integrator=once), "luxcore", tmp_path, 64, 64
    )
    across = (np.arange(64) - 31.5) / 32.0 * 4.0 * math.tan(math.radians(20.0))
    theta = np.arctan(np.hypot(across[:, None], across) / 2.0)
    even_cone = 0.5 / math.pi * 10.0 * np.cos(theta) ** 3 / 4.0
    for low in range(0, 40, 4):
        ring = (theta >= math.radians(low)) & (theta < math.radians(low + 4))
        found = (picture.mean(axis=-1) / even_cone)[ring].mean()
        print(f"{low} to {low + 4} degrees: {found:.3f} of the light of the axis")
        assert found == pytest.approx((1.0 / np.cos(theta[ring])).mean(), rel=0.005)


def test_a_spot_of_luxcore_grows_with_the_angle_and_its_power_is_kept() -> None:
    """A wide one has more light than any cone of the intensity of its axis: the cone is brighter then."""
    from scenes.formats.appearance.spot_profiles import flux, reshaped

    for inner, outer in ((19.0, 20.0), (35.0, 45.0), (0.0, 60.0), (79.0, 80.0), (20.0, 20.0)):
        theta = (np.arange(400_000) + 0.5) * math.radians(outer) / 400_000
        low, high = math.cos(math.radians(outer)), math.cos(math.radians(inner))
        x = np.clip((np.cos(theta) - low) / max(high - low, 1e-12), 0.0, 1.0)
        power = float((x**4 * np.tan(theta)).mean() * math.radians(outer))
        assert flux("secant", inner, outer) == pytest.approx(power, rel=1e-3)
        spot = SpotLight((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (2.0, 2.0, 2.0), inner, outer, "secant")
        for profile in ("hermite", "quartic", "linear"):
            made = reshaped(spot, profile, LossReport())
            kept = made.intensity[0] * flux(profile, made.inner_deg, made.outer_deg)
            assert kept == pytest.approx(2.0 * power, rel=1e-3) and made.outer_deg == outer


def test_black_bodies_of_mitsuba_have_their_own_radiance(tmp_path: Path) -> None:
    """5000 K: Planck's law at its peak is 12799 W m⁻² sr⁻¹ nm⁻¹."""
    assert planck(np.array([579.55]), 5000.0)[0] == pytest.approx(12799.0, rel=1e-3)
    assert radiant_rgb(5000.0, 1.0) == pytest.approx((15222.0, 12107.0, 9590.0), rel=5e-3)
    body = '<emitter type="constant"><blackbody name="radiance" temperature="5000" scale="2"/></emitter>'
    (light,) = mitsuba(tmp_path, body)[0].lights
    assert isinstance(light, EnvironmentLight)
    assert light.image[0, 0] == pytest.approx((30444.0, 24214.0, 19180.0), rel=5e-3)


def mirrored_lamps() -> Scene:
    """Four square lamps that face the camera: a rectangle and a mesh, each as it is and mirrored along x."""
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    uneven = Mesh(np.concatenate([square, [[1.2, 0.0, 0.0]]]).astype(np.float32), np.array(
        [[0, 1, 2], [0, 2, 3], [1, 4, 2]], np.int32))  # fmt: skip
    places = [np.diag([0.4 * sign, 0.4, 1.0, 1.0]) for sign in (1.0, -1.0)]
    lamps = []
    for row, shape in enumerate((Rectangle(), uneven)):
        for column, place in enumerate(places):
            at = place.copy()
            at[:2, 3] = column - 0.5, 0.5 - row
            lamps.append(Instance(shape, Matte(ConstantTexture((0.0, 0.0, 0.0))), at, emission=(1.0, 1.0, 1.0)))
    view = np.eye(4)
    view[2, 3] = 10.0
    return Scene(PerspectiveCamera(view, math.degrees(2.0 * math.atan(0.1))), tuple(lamps), (), Film(32, 32))


@pytest.mark.parametrize("program", ["mitsuba", "luxcore"])
def test_mirrored_lamps_shine_to_their_own_side(program: str, tmp_path: Path) -> None:
    scene = mirrored_lamps()
    picture = drawn(scene, program, tmp_path, 32, 4)
    assert [picture[y, x].tolist() for y in (8, 24) for x in (8, 24)] == [[1.0] * 3] * 4
    ending = ENDINGS[program]
    again = load_scene_file(tmp_path / f"a{ending}") if program == "luxcore" else scene
    assert (drawn(again, "luxcore", tmp_path / "b", 32, 4)[8::16, 8::16] == 1.0).all()


def test_a_mirrored_lamp_of_luxrender_shines_the_other_way(tmp_path: Path) -> None:
    """LuxCore's pictures: its lamps shine to where their faces, as placed, are counter-clockwise."""
    lamp = 'AreaLightSource "area" "color L" [1 1 1] "float power" [0] "float efficacy" [0]\nShape "trianglemesh" '
    lamp += '"integer indices" [0 1 2 0 2 3] "point P" [-1 -1 0 1 -1 0 1 1 0 -1 1 0]\n'
    for transform, expected in (("", 1.0), ("Scale -1 1 1\n", 0.0), ("Scale -1 1 -1\n", 0.0), ("Scale 1 1 -1\n", 1.0)):
        (tmp_path / "a.lxs").write_text(f"{HEAD}{transform}{lamp}")
        (found,) = load_scene_file(tmp_path / "a.lxs").instances
        normal = np.linalg.inv(found.to_world[:3, :3]).T @ [0.0, 0.0, 1.0]
        assert isinstance(found.shape, Rectangle) and (normal[2] > 0.0) == (expected == 1.0)


# --- materials under an even sky of radiance 1: a picture is their albedo -------------------------------------------


def even(value: float) -> ConstantTexture:
    return ConstantTexture((value,) * 3)


STRAIGHT = 0.04  # of a coat of index 1.5, by Fresnel's equations
ALBEDOS: list[tuple[Material, float]] = [
    (Matte(even(0.4)), 0.4),
    (Plastic(even(0.4), even(0.0), 1.5, 0.46, layered=False), 0.4),
    (Plastic(even(0.4), even(0.5), 1.5, 0.1, layered=False), 0.4 + 0.5 * STRAIGHT),
    (Uber(even(0.3), even(0.25), even(0.2), even(0.0), even(1.0), 1.5, (0.1, 0.1)), 0.3 + 0.45 * STRAIGHT),
    (Plastic(even(0.4), even(0.0), 1.5, 0.0), 0.4 * (1.0 - STRAIGHT)),
]


def furnace(materials: list[Material]) -> Scene:
    """Squares side by side, seen from afar, straight on."""
    count, squares = len(materials), []
    for number, material in enumerate(materials):
        place = np.diag([0.5, 0.5, 1.0, 1.0])
        place[0, 3] = number + 0.5 - 0.5 * count
        squares.append(Instance(Rectangle(), material, place))
    view = np.eye(4)
    view[2, 3] = 200.0
    camera = PerspectiveCamera(view, math.degrees(2.0 * math.atan(count / 400.0)))
    sky = EnvironmentLight(np.ones((1, 1, 3), np.float32))
    return Scene(camera, tuple(squares), (sky,), Film(64, 64), integrator=Integrator("path", 2))


@pytest.mark.parametrize("via", ["", ".pbrt", ".xml", ".lxs"])
@pytest.mark.parametrize("program", ["mitsuba", "luxcore"])
def test_materials_keep_their_brightness(program: str, via: str, tmp_path: Path) -> None:
    """Also by way of another format. What lies under a coat is dimmed by its mean in PBRT: 0.363 for 0.384."""
    scene = furnace([material for material, _ in ALBEDOS])
    if via:
        save_scene_file(scene, tmp_path / f"via{via}")
        scene = load_scene_file(tmp_path / f"via{via}")
    file = tmp_path / f"a{ENDINGS[program]}"
    save_scene_file(scene, file, {"mitsuba": "mitsuba3", "luxcore": "luxrender"}[program])
    picture, side = seen(program, file, 40, 256), 40 / len(ALBEDOS)
    found = [picture[17:23, int(at * side) + 2 : int((at + 1) * side) - 1].mean() for at in range(len(ALBEDOS))]
    print(program, via or "direct", " ".join(f"{value:.3f}" for value in found))
    np.testing.assert_allclose(found, [albedo for _, albedo in ALBEDOS], atol=0.026)
    assert found[1] == pytest.approx(0.4, abs=0.004 if program == "mitsuba" else 0.015)


def test_what_a_blunt_coat_takes_from_its_base(tmp_path: Path) -> None:
    """Mitsuba 3 draws both; PBRT dims the base by the mean of a smooth coat."""
    scene = furnace([Plastic(even(0.4), even(0.0), 1.5, 0.46, distribution="beckmann")])
    save_scene_file(scene, tmp_path / "via.pbrt")
    kept = [drawn(one, "mitsuba", tmp_path).mean() / 0.4 for one in (scene, load_scene_file(tmp_path / "via.pbrt"))]
    assert kept == pytest.approx([0.73, 0.91], abs=0.005)


def test_the_plastic_of_a_file_is_as_bright_as_it_says(tmp_path: Path) -> None:
    scene = load_scene_file(CASES / "plastic" / "plasticrgbd040.pbrt")
    assert scene.instances[0].material.layered is False  # type: ignore[union-attr]
    for program in ENDINGS:
        assert drawn(scene, program, tmp_path, 32, 64).mean() == pytest.approx(0.4, abs=0.004)


def test_plastic_comes_back_from_mitsuba_and_pbrt(tmp_path: Path) -> None:
    plastic = Plastic(even(0.4), even(0.25), 1.5, 0.1, layered=False)
    scene = dataclasses.replace(furnace([plastic]), lights=())
    for ending in (".xml", ".pbrt"):
        save_scene_file(scene, tmp_path / f"a{ending}")
        found = load_scene_file(tmp_path / f"a{ending}").instances[0].material
        assert isinstance(found, Plastic) and not found.layered and found.ior == 1.5 and found.roughness == 0.1
        for ours, theirs in ((plastic.diffuse, found.diffuse), (plastic.specular, found.specular)):
            assert theirs.value == pytest.approx(ours.value)  # type: ignore[union-attr]


def test_what_a_smooth_dielectric_reflects_of_even_light() -> None:
    """0.0918 for an index of 1.5: tables of Egan and Hilgeman."""
    assert mean_reflectance(1.5) == pytest.approx(0.0918, abs=2e-4)
    assert mean_reflectance(1.0 + 1e-9) == pytest.approx(0.0, abs=1e-6)


def test_uber_is_a_mixture_that_sums_to_one_at_most() -> None:
    from scenes.formats.appearance.mixtures import lobes_of

    report = LossReport()
    made = lobes_of(Uber(even(0.9), even(0.9), even(0.0), even(0.0)), "uber", report)
    assert isinstance(made, MixMaterial) and isinstance(made.second, Metal)
    assert [loss.what for loss in report.losses] == ["lobes that reflect 1.8 in total"]
    assert BLUNT < 0.01
