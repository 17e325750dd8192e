"""PBRT files, read into the canonical scene."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    DirectionalLight,
    EnvironmentLight,
    Masked,
    Matte,
    Mesh,
    MixMaterial,
    OrthographicCamera,
    PerspectiveCamera,
    Sphere,
    SpotLight,
    Uber,
)
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from tests.scenes.formats.files import HEAD, pbrt


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ('"float fov" 35', 35.0),
        ("", 90.0),
        ('"float halffov" 20', 40.0),
        (
            '"float fov" 35 "float screenwindow" [-2 2 -2 2]',
            math.degrees(2 * math.atan(2 * math.tan(math.radians(17.5)))),
        ),
        ('"float fov" 35 "float screenwindow" [-1.7778 1.7778 -1 1]', 35.0),
    ],
)
def test_field_of_view_is_that_of_the_shorter_side(parameters: str, expected: float, tmp_path: Path) -> None:
    scene, _ = pbrt(tmp_path, "", f'Camera "perspective" {parameters}\nWorldBegin\n')
    assert isinstance(scene.camera, PerspectiveCamera) and scene.camera.fov_deg == pytest.approx(expected)


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize(
    ("size", "window", "half", "stretched"),
    [
        ((32, 16), (-3, 3, -1, 1), 1.0, (1.5, 1.0)),
        ((16, 32), (-3, 3, -1, 1), 3.0, (1.0, 1.0 / 6.0)),
        ((16, 16), (-3, 3, -1, 1), 1.0, (3.0, 1.0)),
        ((32, 16), (-2.001, 2.001, -1, 1), 1.0, (1.0, 1.0)),
    ],
)
def test_a_window_of_another_aspect_is_stretched_or_reported(
    size: tuple[int, int],
    window: tuple[float, ...],
    half: float,
    stretched: tuple[float, float],
    first: bool,
    tmp_path: Path,
) -> None:
    film = f'Film "image" "integer xresolution" {size[0]} "integer yresolution" {size[1]}\n'
    for kind in ("orthographic", "perspective"):
        (tmp_path / kind).mkdir()
        line = f'Camera "{kind}" "float screenwindow" {list(window)}\n'.replace(",", "")
        head = (film + line if first else line + film) + "WorldBegin\n"
        scene, losses = pbrt(tmp_path / kind, "", head)
        camera = scene.camera
        if isinstance(camera, OrthographicCamera):
            np.testing.assert_allclose(np.diag(camera.to_world)[:2], stretched)
            assert camera.half_width == half and losses == []
            save_scene_file(scene, tmp_path / "b.pbrt")
            assert difference(camera, load_scene_file(tmp_path / "b.pbrt").camera) is None
        else:
            assert isinstance(camera, PerspectiveCamera)
            assert camera.fov_deg == pytest.approx(math.degrees(2.0 * math.atan(half)))
            assert len(losses) == (stretched != (1.0, 1.0))


def test_transforms_and_attribute_stacks(tmp_path: Path) -> None:
    body = """
    Translate 1 0 0
    AttributeBegin
      Scale 2 2 2
      CoordinateSystem "here"
      TransformBegin
        Rotate 90 0 0 1
        Translate 1 0 0
        Shape "sphere"
      TransformEnd
      Shape "sphere" "float radius" 3
      AttributeBegin
        Identity
        CoordSysTransform "here"
        Shape "sphere"
        Material "mirror"
      AttributeEnd
      Transform [1 0 0 0  0 1 0 0  0 0 1 0  7 8 9 1]
      ConcatTransform [1 0 0 0  0 1 0 0  0 0 1 0  0 0 1 1]
      Shape "sphere"
    AttributeEnd
    Shape "sphere"
    """
    scene, losses = pbrt(tmp_path, body)
    found = [one.to_world[:3, 3].tolist() for one in scene.instances]
    np.testing.assert_allclose(found, [[1, 2, 0], [1, 0, 0], [1, 0, 0], [7, 8, 10], [1, 0, 0]], atol=1e-12)
    assert scene.instances[1].shape == Sphere(3.0) and not losses
    assert all(one.material == Matte(ConstantTexture((0.5, 0.5, 0.5))) for one in scene.instances)


def test_motion_is_kept_where_it_is_rigid(tmp_path: Path) -> None:
    body = """
    TransformTimes 0 2
    AttributeBegin
      ActiveTransform EndTime
      Translate 4 0 0
      Rotate 90 0 0 1
      ActiveTransform All
      Shape "sphere"
      ActiveTransform EndTime
      Scale 2 2 2
      ActiveTransform All
      Shape "sphere"
    AttributeEnd
    """
    scene, losses = pbrt(tmp_path, body)
    track = scene.instances[0].track
    assert track is not None and (track.start_s, track.interval_s) == (0.0, 2.0)
    np.testing.assert_allclose(track.translation, [[0, 0, 0], [4, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(track.rotation[1], [0, 0, math.sqrt(0.5), math.sqrt(0.5)], atol=1e-12)
    assert scene.instances[1].track is None and ["a motion that is not rigid" in loss for loss in losses] == [True]


def test_roughness_is_remapped_where_pbrt_does(tmp_path: Path) -> None:
    """A roughness of 0.5 is an alpha of 0.8058 (the polynomial by hand); false takes it as it is."""
    body = 'Material "metal" "float roughness" 0.5 {}\nShape "sphere"\n'
    remapped, _ = pbrt(tmp_path, body.format(""))
    plain, _ = pbrt(tmp_path, body.format('"bool remaproughness" "false"'))
    x = math.log(0.5)
    alpha = 1.62142 + 0.819955 * x + 0.1734 * x**2 + 0.0171201 * x**3 + 0.000640711 * x**4
    assert remapped.instances[0].material.roughness == pytest.approx((alpha, alpha))
    assert plain.instances[0].material.roughness == (0.5, 0.5)


def test_materials_and_textures_of_pbrt(tmp_path: Path) -> None:
    body = """
    Texture "c" "spectrum" "checkerboard" "float uscale" 3 "float vscale" 2 "rgb tex1" [1 0 0] "rgb tex2" [0 0 1]
    Texture "h" "float" "constant" "float value" 0.25
    MakeNamedMaterial "a" "string type" "mirror"
    MakeNamedMaterial "b" "string type" "matte" "texture Kd" "c" "float sigma" 20
    Material "mix" "string namedmaterial1" "a" "string namedmaterial2" "b" "rgb amount" [0.2 0.2 0.2]
    Shape "sphere"
    Material "uber" "rgb Kd" [.1 .2 .3] "rgb opacity" [.5 .5 .5] "texture bumpmap" "h" "float strange" 3
    Shape "sphere" "float alpha" 0.5
    Material "hair"
    Shape "curve" "point P" [0 0 0 1 1 1 2 2 2 3 3 3]
    """
    scene, losses = pbrt(tmp_path, body)
    mixed, bumped, hair = (one.material for one in scene.instances)
    assert isinstance(hair, Matte)
    assert isinstance(mixed, MixMaterial) and isinstance(mixed.second, type(scene.materials["a"]))
    assert mixed.first == scene.materials["b"] and mixed.amount == ConstantTexture((0.2, 0.2, 0.2))
    checks = scene.materials["b"].reflectance
    assert isinstance(checks, CheckerboardTexture) and checks.uv_scale == (3.0, 2.0)
    assert isinstance(bumped, Masked) and isinstance(bumped.base.base, Uber)
    assert [loss.split(": ", 1)[1] for loss in losses] == [
        "material 'uber': parameter 'strange': left out",
        "material 'hair': matte of its base colour",
    ]


def test_lights_of_pbrt(tmp_path: Path) -> None:
    body = """
    LightSource "distant" "point from" [0 0 9] "point to" [0 0 0] "rgb L" [1 2 3] "rgb scale" [2 2 2]
    LightSource "spot" "float coneangle" 40 "float conedeltaangle" 10 "rgb I" [1 1 1]
    LightSource "infinite" "blackbody L" [6500 2]
    MakeNamedMedium "fog" "string type" "heterogeneous"
    """
    scene, losses = pbrt(tmp_path, body)
    sun, spot, sky = scene.lights
    assert sun == DirectionalLight((0.0, 0.0, -1.0), (2.0, 4.0, 6.0))
    assert isinstance(spot, SpotLight) and (spot.inner_deg, spot.outer_deg) == (30.0, 40.0)
    assert isinstance(sky, EnvironmentLight) and sky.image.shape == (1, 1, 3)
    assert len(losses) == 1 and "participating medium" in losses[0]


def test_environment_maps_keep_their_directions(tmp_path: Path) -> None:
    """A texel of PBRT's map at u, θ lies along (cos 2πu sin θ, sin 2πu sin θ, cos θ), by our axes as by its."""
    from torch import rand

    from renderer.film.files import write_exr

    write_exr(tmp_path / "sky.exr", rand(8, 16, 3))
    body = 'Rotate 30 0 1 0\nLightSource "infinite" "string mapname" "sky.exr"\n'
    scene, _ = pbrt(tmp_path, body)
    (light,) = scene.lights
    angle = math.radians(30.0)
    turn = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    for u, theta in ((0.1, 0.3), (0.6, 2.0), (0.9, 1.2)):
        phi = 2.0 * math.pi * u
        theirs = turn @ [math.cos(phi) * math.sin(theta), math.sin(phi) * math.sin(theta), math.cos(theta)]
        canonical = [math.sin(phi) * math.sin(theta), math.cos(theta), -math.cos(phi) * math.sin(theta)]
        np.testing.assert_allclose(light.to_world[:3, :3] @ canonical, theirs, atol=1e-12)


def test_cameras_of_other_kinds(tmp_path: Path) -> None:
    for kind, ending in (("orthographic", ".pbrt"), ("environment", ".pbrt"), ("realistic", ".pbrt")):
        scene, _ = pbrt(tmp_path, "", HEAD.replace("perspective", kind))
        save_scene_file(scene, tmp_path / f"out{ending}")
        assert difference(scene, load_scene_file(tmp_path / f"out{ending}")) is None


def test_triindices_beside_indices_are_a_loss(tmp_path: Path) -> None:
    points = '"point P" [0 0 0 1 0 0 0 1 0 1 1 0]'
    scene, lost = pbrt(
        tmp_path, f'Shape "trianglemesh" "integer indices" [0 1 2] "integer triindices" [1 3 2] {points}\n'
    )
    assert len(scene.instances[0].shape.faces) == 1 and any("triindices beside indices" in loss for loss in lost)


def test_subdivision_surfaces_have_the_levels_of_their_file(tmp_path: Path) -> None:
    """A tetrahedron, whose corners come to a fifth of their distance from the middle."""
    points = '"point P" [ 1 1 1 -1 -1 1 -1 1 -1 1 -1 -1 ] "integer indices" [ 0 1 2 0 3 1 0 2 3 1 3 2 ]'
    for levels, count in (("", 256), ('"integer nlevels" 1', 16), ('"integer levels" 0', 4)):
        scene, lost = pbrt(tmp_path, f'Shape "loopsubdiv" {points} {levels}')
        (found,) = scene.instances
        assert isinstance(found.shape, Mesh) and len(found.shape.faces) == count and len(lost) == 1
    corner = pbrt(tmp_path, f'Shape "loopsubdiv" {points}')[0].instances[0].shape.vertices[0]  # type: ignore[union-attr]
    assert corner == pytest.approx((0.2, 0.2, 0.2), abs=0.01)


@pytest.mark.parametrize("kind", ["sphere", "cylinder"])
@pytest.mark.parametrize("height", [0.5, 1.0])
def test_heights_may_come_in_any_order(kind: str, height: float, tmp_path: Path) -> None:
    """The outside is where it is for the other order."""
    ends = [f'"float zmin" {low} "float zmax" {-low}' for low in (-height, height)]
    first, second = (pbrt(tmp_path, f'Shape "{kind}" {both}\n')[0] for both in ends)
    assert difference(first, second) is None
