"""Files of PBRT v4, made by hand after its documentation."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    Bumped,
    CheckerboardTexture,
    ConstantTexture,
    DirectionalLight,
    EnvironmentLight,
    Film,
    Glass,
    ImageTexture,
    Instance,
    Integrator,
    Masked,
    Matte,
    Mesh,
    Metal,
    MixMaterial,
    PerspectiveCamera,
    Plastic,
    PointLight,
    Rectangle,
    Scene,
    SceneError,
    Sphere,
    SpotLight,
    Translucent,
)
from scenes.formats.appearance.coats import sent_back, with_bounces, without_bounces
from scenes.formats.appearance.equal_area import (
    direction_of_square,
    equal_area,
    latitude_longitude,
    square_of_direction,
)
from scenes.formats.appearance.indices import reflectance_of_index
from scenes.formats.appearance.spectra import METALS
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from scenes.formats.pbrt.version import is_v4

HEAD = """Option "integer seed" 3
LookAt 0 1 -5  0 1 0  0 1 0
Camera "perspective" "float fov" 40
Sampler "zsobol" "integer pixelsamples" [ 64 ]
Integrator "volpath" "integer maxdepth" [ 7 ]
PixelFilter "triangle" "float xradius" 1 "float yradius" 1
Film "rgb" "integer xresolution" 60 "integer yresolution" 40 "string filename" "a.exr"
WorldBegin
"""
BODY = """
LightSource "point" "point3 from" [ 0 3 0 ] "rgb I" [ 4 5 6 ] "float scale" 2
LightSource "spot" "point3 from" [ 0 3 0 ] "point3 to" [ 0 0 0 ] "rgb I" [ 10 10 10 ] "float coneangle" 20
AttributeBegin
  MakeNamedMaterial "red" "string type" "diffuse" "rgb reflectance" [ .8 .1 .1 ]
AttributeEnd
MakeNamedMaterial "gold" "string type" "conductor" "spectrum eta" "metal-Au-eta" "spectrum k" "metal-Au-k"
  "float roughness" .04
MakeNamedMaterial "both" "string type" "mix" "string materials" [ "red" "gold" ] "float amount" .25
Attribute "shape" "float radius" 2
AttributeBegin
  NamedMaterial "red"
  Attribute "shape" "float radius" .5
  Shape "sphere"
  Shape "sphere" "float radius" .25 "float alpha" .5
AttributeEnd
NamedMaterial "both"
Shape "sphere"
Material "dielectric" "float eta" 1.3 "float roughness" 0.25 "bool remaproughness" false
Shape "trianglemesh" "integer indices" [ 0 1 2 ] "point3 P" [ 0 0 0  1 0 0  0 1 0 ] "point2 uv" [ 0 0 1 0 0 1 ]
Material "thindielectric"
Import "part.pbrt"
Shape "disk" "float radius" 1
"""
PART = 'Translate 5 0 0\nMaterial "interface"\nShape "sphere"\nMaterial "diffusetransmission"\nShape "sphere"\n'


def read(folder: Path, body: str, head: str = HEAD) -> tuple[Scene, list[str]]:
    (folder / "a.pbrt").write_text(head + body)
    report = LossReport()
    return load_scene_file(folder / "a.pbrt", None, report), [str(loss) for loss in report.losses if loss.picture]


def of(folder: Path, material: str) -> tuple[object, list[str]]:
    scene, losses = read(folder, f'Material {material}\nShape "sphere"\n')
    return scene.instances[0].material, losses


def test_what_a_file_says_and_that_it_comes_back(tmp_path: Path) -> None:
    (tmp_path / "part.pbrt").write_text(PART)
    scene, losses = read(tmp_path, BODY)
    assert losses == []
    assert scene.film == Film(60, 40, "tent", 1.0, "a.exr") and scene.integrator == Integrator("path", 7)
    assert scene.camera.fov_deg == 40.0  # type: ignore[union-attr]
    lamp, spot = scene.lights
    assert lamp == PointLight((0.0, 3.0, 0.0), (8.0, 10.0, 12.0))
    assert isinstance(spot, SpotLight) and (spot.inner_deg, spot.profile) == (15.0, "hermite")
    one, two, mixed, glass, leaf, pane = scene.instances
    red, gold = Matte(ConstantTexture((0.8, 0.1, 0.1))), Metal(*METALS["Au"], (0.2, 0.2))
    assert [part.shape for part in (one, two, mixed)] == [Sphere(0.5), Sphere(0.25), Sphere(2.0)]
    assert one.material == red and isinstance(two.material, Masked) and two.material.base is one.material
    assert mixed.material == MixMaterial(red, gold, ConstantTexture((0.25,) * 3))
    assert glass.material == Glass(ior=1.3, roughness=(0.25, 0.25)) and pane.material == Glass(thin=True)
    assert isinstance(leaf.material, Translucent) and leaf.to_world[0, 3] == 5.0 and pane.to_world[0, 3] == 0.0
    save_scene_file(scene, tmp_path / "b.pbrt", "pbrt4", strict=True)
    assert is_v4((tmp_path / "b.pbrt").read_text())
    assert difference(scene, load_scene_file(tmp_path / "b.pbrt")) is None


def test_versions_are_told_apart() -> None:
    old = 'WorldBegin\nMaterial "matte" "rgb Kd" [1 0 0]\nTexture "a" "spectrum" "constant"\nShape "sphere"\n'
    assert not is_v4(old) and not is_v4(f'{old}Film "image"\n# Material "diffuse"\n')
    for sign in ('Film "rgb"', 'Material "coateddiffuse"', 'Attribute "shape"', 'X "string type" ["interface"]',
                 'LightSource "point" "float power" 3', 'Shape "bilinearmesh"'):  # fmt: skip
        assert is_v4(f"{old}{sign}\n") and not is_v4(f"{old}{sign}\nWorldEnd\n")


def test_materials(tmp_path: Path) -> None:
    made, losses = of(tmp_path, '"coateddiffuse" "rgb reflectance" [ .5 .5 .5 ] "float roughness" .09')
    assert losses == [] and isinstance(made, Plastic) and made.roughness == pytest.approx(0.3)
    back = sent_back(1.5)
    assert made.diffuse.value[0] == pytest.approx(0.5 * (1 - back) / (1 - 0.5 * back))  # type: ignore[union-attr]
    made, losses = of(tmp_path, '"conductor" "rgb reflectance" [ .9 .5 .2 ]')
    assert isinstance(made, Metal) and losses == []
    assert reflectance_of_index(made.eta, made.k) == pytest.approx((0.9, 0.5, 0.2))
    made, losses = of(tmp_path, '"coatedconductor"')
    assert isinstance(made, Metal) and made.eta == METALS["Cu"][0] and "a coat of alpha 0 over metal" in losses[0]
    made, losses = of(tmp_path, '"dielectric" "spectrum eta" "glass-BK7"')
    assert made == Glass(ior=1.5168) and "dispersion" in losses[0]
    made, losses = of(tmp_path, '"hair"')
    assert isinstance(made, Matte) and len(losses) == 1
    made, losses = of(tmp_path, '"diffuse" "float sigma" 3 "string normalmap" "n.png"')
    assert [loss.split(": ", 1)[1] for loss in losses] == [
        "a normal map: none", "material 'diffuse': parameter 'sigma': left out"
    ]  # fmt: skip
    body = 'Texture "t" "float" "checkerboard" "float uscale" 4\nMaterial "diffuse" "texture displacement" "t"\n'
    scene, losses = read(tmp_path, body + 'Shape "sphere"')
    assert isinstance(scene.instances[0].material, Bumped) and losses == []
    for ior in (1.0, 1.3, 2.4):
        base = CheckerboardTexture(ConstantTexture((0.9, 0.2, 0.0)), ConstantTexture((1.0, 0.5, 0.1)))
        there = with_bounces(without_bounces(base, ior, "", LossReport()), ior, "", LossReport())
        assert difference(base, there, 1e-9) is None


@pytest.mark.parametrize(
    ("light", "wanted"),
    [
        (f'"point" "float power" {4 * math.pi * 3}', PointLight((0, 0, 0), (3.0,) * 3)),
        ('"distant" "float illuminance" 5 "rgb L" [ 1 .5 0 ]', DirectionalLight((0, 0, 1), (5.0, 2.5, 0.0))),
        ('"infinite" "float illuminance" 6', EnvironmentLight(np.full((1, 1, 3), 6 / math.pi, np.float32))),
    ],
)
def test_lights_by_their_power(light: str, wanted: object, tmp_path: Path) -> None:
    scene, losses = read(tmp_path, f"LightSource {light}\n")
    assert losses == [] and difference(scene.lights[0], wanted) is None


def test_the_power_of_a_spot_and_of_an_area(tmp_path: Path) -> None:
    """A spot of a power sends it, by a sum over its cone; a lamp sends ``π`` times its area times its radiance."""
    (spot,) = read(tmp_path, 'LightSource "spot" "float power" 7 "float coneangle" 40 "float conedeltaangle" 15')[
        0
    ].lights
    assert isinstance(spot, SpotLight)
    cosine = np.linspace(math.cos(math.radians(40)), 1.0, 200_001)
    x = np.clip((cosine - cosine[0]) / (math.cos(math.radians(25)) - cosine[0]), 0.0, 1.0)
    assert spot.intensity[0] * 2 * math.pi * np.trapezoid(x * x * (3 - 2 * x), cosine) == pytest.approx(7.0, rel=1e-6)
    scene, _ = read(tmp_path, 'Scale 2 2 2\nAreaLightSource "diffuse" "float power" 5\nShape "disk"')
    assert scene.instances[0].emission[0] == pytest.approx(5.0 / (math.pi * 4 * math.pi), rel=0.002)  # type: ignore[index]


def test_spectra_of_lights_have_luminance_one(tmp_path: Path) -> None:
    for given in ('"blackbody I" 3000', '"spectrum I" [ 400 1 700 3 ]', '"spectrum I" "stdillum-A"'):
        scene, losses = read(tmp_path, f'LightSource "point" {given} "float scale" 2')
        lamp = scene.lights[0]
        assert losses == [] and isinstance(lamp, PointLight) and lamp.intensity[0] > lamp.intensity[2]
        assert np.dot(lamp.intensity, (0.2126729, 0.7151522, 0.0721750)) == pytest.approx(2.0)


def test_the_exposure_of_a_film_is_a_loss(tmp_path: Path) -> None:
    head = HEAD.replace('"float fov" 40', '"float fov" 40 "float shutterclose" .5')
    assert read(tmp_path, "", head)[1] == ["film: an exposure of 0.5 (shutter and iso): 1"]
    scene, losses = read(tmp_path, "", head.replace('Film "rgb"', 'Film "rgb" "float iso" 200'))
    assert losses == [] and isinstance(scene.camera, PerspectiveCamera) and scene.camera.shutter_s == (0.0, 0.5)
    save_scene_file(scene, tmp_path / "b.pbrt", "pbrt4", strict=True)
    assert '"float iso" [ 200 ]' in (tmp_path / "b.pbrt").read_text()


def test_maps_of_equal_area(tmp_path: Path) -> None:
    points = np.random.default_rng(0).random((1000, 2))
    there = direction_of_square(points)
    np.testing.assert_allclose(np.linalg.norm(there, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(square_of_direction(there), points, atol=1e-9)
    fixed = {(0.5, 0.5): (0, 0, 1), (1.0, 0.5): (1, 0, 0), (0.5, 1.0): (0, 1, 0), (0.0, 0.0): (0, 0, -1)}
    np.testing.assert_allclose(direction_of_square(np.array(list(fixed))), list(fixed.values()), atol=1e-9)
    assert abs(there.mean(axis=0)).max() < 0.05  # even over the sphere
    square = np.zeros((16, 16, 3), np.float32)
    square[8, 15] = 1.0  # near +x
    image = latitude_longitude(square)
    row, column = np.unravel_index(image[..., 0].argmax(), image.shape[:2])
    assert row in (7, 8) and column in (0, 1)
    smooth = latitude_longitude(equal_area(image))
    weight = np.sin((np.arange(16) + 0.5) / 16 * np.pi)[:, None]
    assert (smooth[..., 0] * weight).sum() == pytest.approx((image[..., 0] * weight).sum(), rel=0.1)


def test_an_environment_map_comes_back(tmp_path: Path) -> None:
    import OpenEXR

    square = np.random.default_rng(1).random((8, 8, 3)).astype(np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": square}).write(str(tmp_path / "e.exr"))
    body = 'Rotate 30 0 0 1\nLightSource "infinite" "string filename" "e.exr" "float scale" 2\n'
    scene, losses = read(tmp_path, body)
    (light,) = scene.lights
    assert losses == [] and isinstance(light, EnvironmentLight) and light.image.shape == (8, 16, 3)
    save_scene_file(scene, tmp_path / "b.pbrt", "pbrt4", strict=True)
    assert difference(scene.lights, load_scene_file(tmp_path / "b.pbrt").lights) is None
    with pytest.raises(SceneError, match="of equal area"):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": square[:4].copy()}).write(str(tmp_path / "e.exr"))
        read(tmp_path, body)


def test_textures(tmp_path: Path) -> None:
    from PIL import Image

    Image.fromarray(np.full((2, 2, 3), 128, np.uint8)).save(tmp_path / "a.png")
    body = 'Texture "t" "spectrum" "imagemap" "string filename" "a.png" "string encoding" "linear" "bool invert" true\n'
    body += 'Texture "s" "spectrum" "scale" "texture tex" "t" "float scale" .5\n'
    scene, losses = read(tmp_path, body + 'Material "diffuse" "texture reflectance" "s"\nShape "sphere"')
    save_scene_file(scene, tmp_path / "b.pbrt", "pbrt4")
    made = load_scene_file(tmp_path / "b.pbrt").instances[0].material
    assert losses == [] and isinstance(made, Matte) and isinstance(made.reflectance, ImageTexture)
    np.testing.assert_allclose(made.reflectance.image, 0.5 * (1 - 128 / 255), rtol=1e-5)


def test_bilinear_patches_are_triangles(tmp_path: Path) -> None:
    patch = 'Shape "bilinearmesh" "point3 P" [ 0 0 0  1 0 0  0 1 0  1 1 {} ] "point2 uv" [ 0 0 1 0 0 1 1 1 ]\n'
    head = HEAD + 'Material "diffuse"\n'
    flat, losses = read(tmp_path, patch.format(0), head)
    assert losses == [] and isinstance(flat.instances[0].shape, Rectangle)
    bent, losses = read(tmp_path, patch.format(1), head)
    assert isinstance(bent.instances[0].shape, Mesh) and len(losses) == 1 and "2 triangles" in losses[0]


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('Import "a.pbrt"', "expected files that do not import themselves"),
        ('Material "mix" "string materials" "a"', "expected two names"),
        ('LightSource "point" "blackbody I" 3', "expected 100 to 1000000 K"),
        ('Material "dielectric" "float roughness" -1', "expected no negative number"),
    ],
)
def test_faults_are_one_line(body: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=message):
        read(tmp_path, body)


def test_mirrors_by_a_texture_keep_their_picture(tmp_path: Path) -> None:
    ball = Instance(Sphere(), Metal((0.0,) * 3, (1.0,) * 3))
    scene = Scene(PerspectiveCamera(), (ball,), integrator=Integrator("path", 5))
    save_scene_file(scene, tmp_path / "b.pbrt", "pbrt4", strict=True)
    made = load_scene_file(tmp_path / "b.pbrt").instances[0].material
    assert isinstance(made, Metal) and reflectance_of_index(made.eta, made.k)[0] > 0.999
