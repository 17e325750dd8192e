"""Light that goes straight through surfaces: holes, borders of media and panes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    Film,
    Glass,
    ImageTexture,
    Instance,
    Integrator,
    Masked,
    Material,
    Matte,
    Mirror,
    MixMaterial,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    Scene,
    Texture,
)
from scenes.formats.appearance.mixtures import NOTHING, lets_through
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.drawable import drawable
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import HEAD, drawn, seen
from tests.scenes.formats.test_light import even, furnace

HALF = Masked(Matte(even(0.4)), even(0.5))


def below_a_lamp(*sheets: Instance) -> Scene:
    """A floor of albedo 0.4 below a point light."""
    view = np.eye(4)
    view[2, 3] = 60.0
    floor = Instance(Rectangle(), Matte(even(0.4)), np.diag([9.0, 9.0, 1.0, 1.0]))
    camera = PerspectiveCamera(view, math.degrees(2.0 * math.atan(0.05 / 60.0)))
    lamp = PointLight((0.0, 0.0, 2.0), (10.0,) * 3)
    return Scene(camera, (*sheets, floor), (lamp,), Film(16, 16), integrator=Integrator("path", 8))


def sheet(material: Material, height: float) -> Instance:
    place = np.diag([4.0, 4.0, 1.0, 1.0])
    place[2, 3] = height
    return Instance(Rectangle(), material, place)


def test_light_of_a_point_passes_the_borders_of_media_in_mitsuba(tmp_path: Path) -> None:
    """The path tracer that Mitsuba calls ``path`` stops it there."""
    bare = drawn(below_a_lamp(), "mitsuba", tmp_path, 16, 16).mean()
    assert bare == pytest.approx(0.4 / math.pi * 10.0 / 4.0, rel=0.01)
    for to in ("mitsuba3", "mitsuba"):
        save_scene_file(below_a_lamp(sheet(NOTHING, 1.0)), tmp_path / "a.xml", to)
        assert seen("mitsuba", tmp_path / "a.xml", 16, 64).mean() == pytest.approx(bare, rel=0.01)


def test_a_surface_with_holes_before_nothing_has_its_share_of_light_in_mitsuba(tmp_path: Path) -> None:
    scene = below_a_lamp()
    scene = replace(scene, instances=(replace(scene.instances[0], material=HALF),))
    wanted = 0.5 * 0.4 / math.pi * 10.0 / 4.0
    assert drawn(scene, "mitsuba", tmp_path, 16, 1024).mean() == pytest.approx(wanted, rel=0.01)
    assert load_scene_file(tmp_path / "a.xml").integrator == scene.integrator


def lost(material: Material, folder: Path) -> list[str]:
    report = LossReport()
    save_scene_file(furnace([material]), folder / "a.lxs", None, report)
    return [loss.what for loss in report.losses if loss.picture]


DIMMED = "light on a part of a mixture with holes or panes"
CUT = ImageTexture(np.eye(4, dtype=np.float32)[..., None].repeat(3, -1))
SOFT = ImageTexture(np.full((2, 2, 3), 0.7, np.float32))


@pytest.mark.parametrize(
    ("opacity", "losses"),
    [(even(0.5), [DIMMED]), (SOFT, [DIMMED]), (CheckerboardTexture(even(1.0), even(0.3)), [DIMMED]), (even(0.0), []),
     (even(1.0), []), (CUT, []), (CheckerboardTexture(even(1.0), even(0.0)), [])],
)  # fmt: skip
def test_luxcore_dims_light_on_what_is_partly_there_which_is_a_loss(
    opacity: Texture, losses: list[str], tmp_path: Path
) -> None:
    assert lost(Masked(Matte(even(0.4)), opacity), tmp_path) == losses


def test_sharp_parts_of_mixtures_keep_their_light_in_luxcore(tmp_path: Path) -> None:
    assert lost(Masked(Mirror(even(0.4)), even(0.5)), tmp_path) == []
    assert lost(MixMaterial(Mirror(even(0.4)), Matte(even(0.4)), even(0.5)), tmp_path) == []
    assert DIMMED in lost(MixMaterial(Glass(thin=True), Matte(even(0.4)), even(0.5)), tmp_path)


def test_the_losses_of_holes_and_panes_are_those_of_luxcore(tmp_path: Path) -> None:
    """A share of the rays meets the surface, whose light is weighted by that share again; a pane has one side."""
    scene = below_a_lamp()
    floor = scene.instances[0]
    masked = drawn(replace(scene, instances=(replace(floor, material=HALF),)), "luxcore", tmp_path, 16, 256).mean()
    assert masked == pytest.approx(0.25 * 0.4 / math.pi * 10.0 / 4.0, rel=0.05)
    for side, wanted in ((1.0, 1.04), (-1.0, 1.0 - 0.04 * (1.0 + 0.96**2))):
        pane = furnace([Glass(thin=True)])
        turned = replace(pane.instances[0], to_world=np.diag([0.5, 0.5 * side, side, 1.0]))
        found = drawn(replace(pane, instances=(turned,)), "luxcore", tmp_path, 16, 4096)[4:12, 4:12].mean()
        assert found == pytest.approx(wanted, abs=0.005)
    report = LossReport()
    save_scene_file(pane, tmp_path / "a.lxs", None, report)
    assert [loss.became for loss in report.losses if loss.what == "a pane"] == [
        "one in LuxCore that reflects 0.04 at its front and lets all through, and nothing at its back"
    ]


def test_architectural_glass_of_luxrender_is_a_loss_elsewhere(tmp_path: Path) -> None:
    body = 'Material "glass" "string type" ["glass"] "bool architectural" ["true"]\n'
    shape = 'Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1 0]\n'
    (tmp_path / "a.lxs").write_text(HEAD + body + shape)
    report = LossReport()
    scene = load_scene_file(tmp_path / "a.lxs", None, report)
    assert scene.instances[0].material == Glass(thin=True, front_only=True)
    save_scene_file(scene, tmp_path / "b.lxs", None, report)
    assert not [loss for loss in report.losses if loss.picture]
    assert difference(scene.instances, load_scene_file(tmp_path / "b.lxs").instances) is None
    for name in ("pbrt", "pbrt4", "mitsuba", "mitsuba3", "gltf"):
        report = LossReport()
        save_scene_file(scene, tmp_path / f"a.{name}", name, report)
        assert "architectural glass" in [loss.what for loss in report.losses]
    report = LossReport()
    drawable(scene, report)
    assert "architectural glass" in [loss.what for loss in report.losses]


def test_a_perfect_mirror_in_a_mixture_of_mitsuba_05_keeps_its_light(tmp_path: Path) -> None:
    """Mitsuba 3 draws the file with facets of a small alpha in place of the mirror."""
    scene = furnace([MixMaterial(Matte(even(0.4)), Mirror(even(0.8)), even(0.25))])
    save_scene_file(scene, tmp_path / "a.xml", "mitsuba")
    assert seen("mitsuba", tmp_path / "a.xml", 16, 256).mean() == pytest.approx(0.75 * 0.4 + 0.25 * 0.8, abs=0.005)


def test_what_lets_light_through() -> None:
    plain = Matte(ConstantTexture((0.1, 0.2, 0.3)))
    assert not lets_through(MixMaterial(plain, Glass(), even(0.5)))
    assert lets_through(MixMaterial(plain, MixMaterial(plain, HALF, even(0.5)), even(0.5)))
