"""USD files that are written, read by the library of the format and by this project."""

from __future__ import annotations

import re
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from analysis.command.extras import extra_of
from scenes.animation import pose_at
from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    DirectionalLight,
    Disk,
    Emissive,
    EnvironmentLight,
    Film,
    Glass,
    ImageTexture,
    Instance,
    Masked,
    Matte,
    Mesh,
    MetallicRough,
    NormalMapped,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    RigidTrack,
    Scene,
    SceneError,
    Sphere,
    SpotLight,
    SunSky,
)
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from scenes.loading import read_image
from tests.scenes.formats.gltf.files import GREY, shown

pytest.importorskip("pxr")
from pxr import Usd, UsdGeom, UsdLux, UsdValidation  # type: ignore[import-not-found]

BLACK = Matte(ConstantTexture((0.0, 0.0, 0.0)))
TRIANGLE = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))


def stage_of(folder: Path, scene: Scene, name: str = "a.usda") -> tuple[Any, list[str]]:
    """The stage of a scene, and the losses that change the picture."""
    report = LossReport()
    save_scene_file(scene, folder / name, None, report)
    return Usd.Stage.Open(str(folder / name)), [str(loss) for loss in report.losses if loss.picture]


def back(folder: Path, scene: Scene, name: str = "a.usda") -> tuple[Scene, list[str]]:
    """The scene that comes back, and the losses of both ways that change the picture."""
    report = LossReport()
    save_scene_file(scene, folder / name, None, report)
    read = load_scene_file(folder / name, None, report)
    return read, [str(loss) for loss in report.losses if loss.picture]


def test_lights_have_their_units(tmp_path: Path) -> None:
    """As the library has them: a sphere of radiance L and radius r has the radiant intensity L π r²."""
    lights = (
        PointLight((1.0, 2.0, 3.0), (4.0, 2.0, 1.0)),
        SpotLight((1.0, 0.0, 0.0), (1.0, 0.0, 1.0), (2.0, 2.0, 2.0), 20.0, 30.0),
        DirectionalLight((0.0, -1.0, 0.0), (0.0, 3.0, 6.0), 2.0),
        EnvironmentLight(np.full((1, 1, 3), 0.25, np.float32), scale=2.0),
    )
    scene = shown(GREY, lights=lights)
    stage, losses = stage_of(tmp_path, scene)
    assert losses == []
    point = UsdLux.SphereLight(stage.GetPrimAtPath("/World/point"))
    radius = point.GetRadiusAttr().Get()
    radiance = point.GetIntensityAttr().Get() / (4.0 * np.pi * radius**2)
    assert point.GetNormalizeAttr().Get() and radiance * np.pi * radius**2 == pytest.approx(4.0)
    assert tuple(point.GetColorAttr().Get()) == (1.0, 0.5, 0.25)
    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/World/sun"))
    assert sun.GetNormalizeAttr().Get() and sun.GetIntensityAttr().Get() == 6.0 and sun.GetAngleAttr().Get() == 2.0
    assert UsdLux.ShapingAPI(stage.GetPrimAtPath("/World/spot")).GetShapingConeAngleAttr().Get() == 30.0
    assert UsdLux.DomeLight(stage.GetPrimAtPath("/World/environment")).GetIntensityAttr().Get() == 0.5
    read, losses = back(tmp_path, scene)
    assert losses == [] and difference(read.lights[:3], lights[:3]) is None
    dome = read.lights[3]
    assert isinstance(dome, EnvironmentLight) and np.all(dome.scale * dome.image == 0.5)


def test_lamps_that_reflect_nothing_are_lights_of_their_sizes(tmp_path: Path) -> None:
    place = np.array([[0.0, 2.0, 0, 1], [0, 0, 3.0, 2], [1.0, 0, 0, 3], [0, 0, 0, 1]])
    sheared = place @ np.array([[1.0, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    shapes = ((Rectangle(), place), (Rectangle(), sheared), (Sphere(0.5), 3.0 * np.eye(4) + np.diag([0, 0, 0, -2.0])),
              (Disk(0.5), np.diag([2.0, 2.0, -1.0, 1.0])))  # fmt: skip
    lamps = tuple(Instance(shape, BLACK, matrix, emission=(8.0, 4.0, 2.0)) for shape, matrix in shapes)
    scene = Scene(PerspectiveCamera(), lamps)
    stage, losses = stage_of(tmp_path, scene)
    assert losses == []
    light = UsdLux.RectLight(stage.GetPrimAtPath("/World/Rectangle0"))
    assert (light.GetWidthAttr().Get(), light.GetHeightAttr().Get()) == (2.0, 4.0)
    assert light.GetIntensityAttr().Get() == 8.0 and not light.GetNormalizeAttr().Get()
    matrix = np.array(UsdGeom.Xformable(light).GetLocalTransformation())
    np.testing.assert_allclose(-matrix[2, :3], place[:3, 2] / 3.0, atol=1e-12)
    assert UsdLux.SphereLight(stage.GetPrimAtPath("/World/Sphere2")).GetRadiusAttr().Get() == 1.5
    read, _ = back(tmp_path, scene)
    for one, other in zip(read.instances, lamps, strict=True):
        assert type(one.shape) is type(other.shape) and one.emission == other.emission and one.material == BLACK
    for number in (0, 1, 3):
        size = getattr(read.instances[number].shape, "radius", 1.0) / getattr(lamps[number].shape, "radius", 1.0)
        axes = read.instances[number].to_world[:3, :2] * size
        np.testing.assert_allclose(axes, lamps[number].to_world[:3, :2], atol=1e-6)
        assert read.instances[number].to_world[:3, 2] @ lamps[number].to_world[:3, 2] > 0.0


def test_lamps_keep_their_sides_and_normals_of_one_direction_their_tilt(tmp_path: Path) -> None:
    tilted = NormalMapped(Matte(ConstantTexture((0.5, 0.5, 0.5))), ConstantTexture((0.7, 0.5, 0.9)))
    parts = (
        Instance(Rectangle(), BLACK, emission=(2.0, 2.0, 2.0), emission_twosided=True),
        Instance(Rectangle(), BLACK, emission=(2.0, 2.0, 2.0)),
        Instance(Rectangle(), GREY, emission=(2.0, 2.0, 2.0), emission_twosided=True),
        Instance(Rectangle(), tilted),
    )
    read, losses = back(tmp_path, Scene(PerspectiveCamera(), parts))
    assert losses == []
    assert [one.emission_twosided for one in read.instances] == [False, False, True, False]
    assert [one.emission for one in read.instances[:3]] == [None, (2.0, 2.0, 2.0), (2.0, 2.0, 2.0)]
    assert [one.material for one in read.instances[:3]] == [Emissive((2.0, 2.0, 2.0)), BLACK, GREY]
    bent = read.instances[3].material
    assert isinstance(bent, NormalMapped) and isinstance(bent.normals, ImageTexture)
    assert bent.normals.image.shape == (1, 1, 3), "one texel is not enlarged"
    np.testing.assert_allclose(bent.normals.image[0, 0], (0.7, 0.5, 0.9), atol=1e-6)
    _, losses = back(tmp_path, Scene(PerspectiveCamera(), (Instance(Rectangle(), GREY, one_sided=True),)), "b.usda")
    assert losses == ["Rectangle0: a surface with a black back: not drawn from behind"]


def test_a_camera_keeps_its_lens_its_shift_and_its_shutter(tmp_path: Path) -> None:
    camera = PerspectiveCamera(np.eye(4), 40.0, 0.05, 7.0, shutter_s=(-0.25, 0.5), shift=(0.1, -0.2))
    scene = Scene(camera, (Instance(TRIANGLE, GREY),), film=Film(200, 100))
    read, losses = back(tmp_path, scene)
    assert losses == [] and difference(read.camera, camera) is None and read.film.width_px == 2 * read.film.height_px
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    lens = UsdGeom.Camera(stage.GetPrimAtPath("/World/camera")).GetCamera()
    assert lens.GetFieldOfView(lens.FOVVertical) == pytest.approx(40.0, abs=1e-4)
    flat = OrthographicCamera(np.eye(4), 3.0)
    read, losses = back(tmp_path, Scene(flat, scene.instances, film=Film(100, 200)), "b.usda")
    assert losses == [] and difference(read.camera, flat) is None


def test_instances_are_shared_and_motion_is_kept(tmp_path: Path) -> None:
    turn = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, np.sin(0.5), np.cos(0.5)]])
    track = RigidTrack(-0.5, 1.0, np.array([[0.0, 0, 0], [2.0, 0, 0]]), turn)
    parts = tuple(Instance(TRIANGLE, GREY, np.diag([size, 1, 1, 1.0])) for size in (1.0, 2.0, 3.0))
    moving = Instance(TRIANGLE, GREY, np.diag([5.0, 1, 1, 1.0]), track)
    stage, losses = stage_of(tmp_path, Scene(PerspectiveCamera(), (*parts, moving)))
    assert losses == ["motion: motion before the time zero: left out"]
    assert sum(prim.IsA(UsdGeom.Mesh) for prim in Usd.PrimRange.AllPrims(stage.GetPseudoRoot())) == 1
    assert len(stage.GetPrototypes()) == 1 and sum(prim.IsInstance() for prim in stage.Traverse()) == 4
    found = load_scene_file(tmp_path / "a.usda").instances
    assert len({id(one.shape) for one in found}) == 1
    for time_s in (0.0, 0.25, 0.5, 9.0):
        expected = pose_at(track, time_s) @ moving.to_world
        assert found[3].track is not None
        np.testing.assert_allclose(pose_at(found[3].track, time_s) @ found[3].to_world, expected, atol=1e-5)


def test_materials_come_back(tmp_path: Path) -> None:
    codes = np.arange(12, dtype=np.float32).reshape(2, 2, 3) / np.float32(255.0)
    picture = ImageTexture(codes, (2.0, -1.0), (0.25, 1.0), "clamp")
    through = ImageTexture(np.repeat(codes[..., :1], 3, axis=2), *((2.0, -1.0), (0.25, 1.0)), "clamp")
    materials = (
        Masked(Matte(picture), through, 0.25),
        NormalMapped(MetallicRough(ConstantTexture((0.5, 0.25, 0.125)), 0.5, 0.25, picture, 1.25, 0.5, 0.125), picture),
        Glass(transmittance=ConstantTexture((0.5, 0.75, 1.0)), ior=1.25, roughness=(0.25, 0.25)),
        Emissive((3.0, 2.0, 1.0)),
    )
    first, losses = back(tmp_path, shown(*materials))
    assert losses == []
    again, losses = back(tmp_path, first, "b.usdz")
    assert losses == [] and difference(first, again) is None
    masked, mapped, glass, glow = (one.material for one in first.instances)
    assert isinstance(masked, Masked) and masked.cutoff == 0.25 and isinstance(masked.base, Matte)
    assert isinstance(masked.base.reflectance, ImageTexture) and isinstance(masked.opacity, ImageTexture)
    np.testing.assert_allclose(masked.base.reflectance.image, codes, atol=1e-7)
    np.testing.assert_allclose(masked.opacity.image[..., 0], codes[..., 0], atol=1e-7)
    assert masked.base.reflectance.wrap == "clamp"
    assert isinstance(mapped, NormalMapped) and isinstance(mapped.base, MetallicRough)
    assert (mapped.base.coat, mapped.base.coat_roughness, mapped.base.ior) == (0.5, 0.125, 1.25)
    assert isinstance(mapped.base.parts, ImageTexture) and isinstance(mapped.normals, ImageTexture)
    np.testing.assert_allclose(mapped.normals.image, codes[::-1], atol=1e-6)  # mirrored in place of its coordinates
    assert glass == materials[2] and glow == materials[3]


def test_what_the_format_does_not_have_is_named(tmp_path: Path) -> None:
    checks = CheckerboardTexture(ConstantTexture((1.0, 1.0, 1.0)), ConstantTexture((0.0, 0.0, 0.0)))
    _, losses = back(tmp_path, shown(Glass(thin=True), Matte(checks), lights=(SunSky((0.0, 0.6, 0.8)),)))
    for what in ("a pane without thickness: a mirror that covers 0.0769", "texels with sharp edges", "sun and sky"):
        assert any(what in loss for loss in losses), losses


def test_packages_are_aligned_and_the_library_finds_no_fault(tmp_path: Path) -> None:
    wide = ImageTexture(np.full((4, 4, 3), 1.5, np.float32))
    save_scene_file(shown(Matte(wide)), tmp_path / "a.usdz")
    assert [path.name for path in tmp_path.iterdir()] == ["a.usdz"]
    content = (tmp_path / "a.usdz").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.usdz") as package:
        names = package.namelist()
        assert names[0] == "a.usdc" and names[1].endswith(".exr") and len(names) == 2
        for entry in package.infolist():
            name, extra = content[entry.header_offset + 26], content[entry.header_offset + 28]
            assert (entry.header_offset + 30 + name + extra) % 64 == 0 and entry.compress_type == zipfile.ZIP_STORED
    checks = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    found = checks.Validate(Usd.Stage.Open(str(tmp_path / "a.usdz")))
    assert [one.GetErrorAsString() for one in found] == []


def test_files_that_cannot_be_written_leave_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    far = Instance(Mesh(np.eye(3) * 1e300, TRIANGLE.faces), GREY)
    for name in ("a.usda", "a.usdc", "a.usdz"):
        with pytest.raises(SceneError, match=f"^{re.escape(str(tmp_path / name))}: expected finite"):
            save_scene_file(Scene(PerspectiveCamera(), (far,)), tmp_path / name)
    bad = np.full((3, 3), np.nan, np.float32)
    bent = Instance(replace(TRIANGLE, normals=bad), GREY)
    beyond = PointLight((float("inf"), 0.0, 0.0), (1.0, 1.0, 1.0))
    for scene, where in (
        (Scene(PerspectiveCamera(), (bent,)), "normals of /World/Mesh0"),
        (shown(GREY, lights=(beyond,)), "a transform of /World/point"),
    ):
        with pytest.raises(SceneError, match=rf"a\.usda: expected finite numbers, got others for {where}"):
            save_scene_file(scene, tmp_path / "a.usda")
    light = PointLight((0.0, 0.0, 0.0), (float("inf"), 1.0, 1.0))
    with pytest.raises(SceneError, match=r"a\.usdc: expected finite"):
        save_scene_file(shown(GREY, lights=(light,)), tmp_path / "a.usdc")
    for module in [name for name in sys.modules if name.startswith("scenes.formats.usd.")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.delitem(sys.modules, "scenes.models.usd_library")
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ModuleNotFoundError) as found:
        save_scene_file(shown(GREY), tmp_path / "a.usda")
    assert "expected the package usd-core" in str(extra_of(found.value))
    assert list(tmp_path.iterdir()) == []


def test_many_shapes_lie_in_groups_and_keep_their_places(tmp_path: Path) -> None:
    names = ("Materials", "more", "camera", *(f"n{number % 7}" for number in range(700)))
    places = [np.eye(4) for _ in names]
    for number, place in enumerate(places):
        place[0, 3] = number
    materials = [Matte(ConstantTexture((number / 1000.0,) * 3)) for number in range(len(names))]
    parts = tuple(
        Instance(TRIANGLE, material, place, name=name)
        for name, material, place in zip(names, materials, places, strict=True)
    )
    stage, losses = stage_of(tmp_path, Scene(PerspectiveCamera(), parts))
    assert losses == []
    assert max(len(prim.GetChildren()) for prim in stage.TraverseAll()) <= 256 + 8
    read = load_scene_file(tmp_path / "a.usda")
    assert sorted(one.to_world[0, 3] for one in read.instances) == list(range(len(names)))
    for one in read.instances:
        assert isinstance(one.material, Matte) and isinstance(one.material.reflectance, ConstantTexture)
        assert one.material.reflectance.value[0] == pytest.approx(one.to_world[0, 3] / 1000.0, abs=1e-6)
    save_scene_file(read, tmp_path / "b.usdc")
    again = load_scene_file(tmp_path / "b.usdc")
    save_scene_file(again, tmp_path / "c.usdc")
    assert difference(again, load_scene_file(tmp_path / "c.usdc")) is None


@pytest.mark.parametrize("colour_first", [True, False])
def test_a_picture_is_kept_as_colours_and_as_numbers(colour_first: bool, tmp_path: Path) -> None:
    Image.fromarray(np.random.default_rng(3).integers(0, 256, (4, 4, 3), np.uint8)).save(tmp_path / "same.png")
    picture = ImageTexture(read_image(tmp_path / "same.png"), source=str(tmp_path / "same.png"))
    materials = [Matte(picture), MetallicRough(ConstantTexture((0.5, 0.5, 0.5)), 0.5, 0.5, picture)]
    found, losses = back(tmp_path, shown(*(materials if colour_first else materials[::-1])))
    matte, rough = (one.material for one in (found.instances if colour_first else found.instances[::-1]))
    assert losses == [] and isinstance(matte, Matte) and isinstance(rough, MetallicRough)
    assert isinstance(matte.reflectance, ImageTexture) and isinstance(rough.parts, ImageTexture)
    np.testing.assert_array_equal(matte.reflectance.image, picture.image)
    np.testing.assert_allclose(rough.parts.image[..., 1] * rough.roughness, 0.5 * picture.image[..., 1], atol=1e-6)


def test_the_picture_of_a_dome_keeps_its_colour_space(tmp_path: Path) -> None:
    Image.fromarray(np.array([[10, 90], [160, 250]], np.uint8)).save(tmp_path / "grey.png")
    image = read_image(tmp_path / "grey.png")
    dome = EnvironmentLight(image, np.eye(4), source=str(tmp_path / "grey.png"))
    found, _ = back(tmp_path, shown(GREY, lights=(dome,)))
    (read,) = found.lights
    assert isinstance(read, EnvironmentLight)
    np.testing.assert_allclose(read.image, image, atol=1e-6)
