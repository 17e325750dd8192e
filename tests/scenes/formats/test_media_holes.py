"""Holes of vacuum within media, whose borders are kept, missing media, and presets."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import Cube, Emissive, Instance, Integrator, Medium, PerspectiveCamera, Rectangle, Scene
from scenes.formats.appearance.media import VACUUM
from scenes.formats.appearance.mixtures import NOTHING, is_nothing
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import SENSOR, drawn, pbrt

FOG = Medium((0.2, 0.1, 0.05))
FORMATS = {"pbrt": ".pbrt", "pbrt4": ".pbrt", "mitsuba": ".xml", "mitsuba3": ".xml", "luxrender": ".lxs"}


def at(z: float, scale: float = 1.0) -> np.ndarray:
    place = np.diag([scale, scale, scale, 1.0])
    place[2, 3] = z
    return place


def scene(exterior: Medium | None, around: Medium | None = FOG) -> Scene:
    """A hole of two units before a wall that shines, five units away, in a medium."""
    wall = Instance(Rectangle(), Emissive((1.0, 1.0, 1.0)), at(-5.0, 20.0))
    hole = Instance(Cube(), NOTHING, at(-2.5), interior=VACUUM, exterior=exterior)
    return Scene(PerspectiveCamera(at(0.0), 30.0), (wall, hole), integrator=Integrator("path", 8), medium=around)


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("exterior", [None, FOG])
def test_holes_within_media_come_back(exterior: Medium | None, name: str, tmp_path: Path) -> None:
    file, report = tmp_path / f"a{FORMATS[name]}", LossReport()
    save_scene_file(scene(exterior), file, name, report)
    hole = load_scene_file(file, None, report).instances[1]
    assert is_nothing(hole.material) and hole.exterior == exterior
    assert hole.interior == (VACUUM if exterior is None else None)
    behind = [loss for loss in report.losses if "vacuum behind" in loss.what]
    assert bool(behind) == (name == "luxrender" and exterior is None)  # LuxCore goes on with the medium around


def test_vacuum_without_media_is_none(tmp_path: Path) -> None:
    save_scene_file(scene(VACUUM, None), tmp_path / "a.pbrt")
    report = LossReport()
    found = load_scene_file(tmp_path / "a.pbrt", None, report)
    assert len(found.instances) == 1 and any("which is invisible" in loss.what for loss in report.losses)


def test_holes_of_files(tmp_path: Path) -> None:
    """A medium that has no coefficients, inside of a shape within another medium."""
    media = 'MakeNamedMedium "{}" "string type" "homogeneous" "rgb sigma_a" [ {} ] "rgb sigma_s" [ 0 0 0 ]\n'
    head = 'Integrator "volpath"\n' + media.format("fog", "1 2 3") + media.format("empty", "0 0 0")
    body = 'Material "none"\nMediumInterface "empty" ""\nShape "sphere"\nMediumInterface "" ""\nShape "sphere"\n'
    found, _ = pbrt(tmp_path, body, f'{head}MediumInterface "" "fog"\nCamera "perspective"\nWorldBegin\n')
    assert [(one.interior, one.exterior) for one in found.instances] == [(VACUUM, None)]
    empty = '<medium type="homogeneous" id="e"><float name="sigma_t" value="0"/></medium>'
    fog = '<shape type="cube"><bsdf type="null"/><medium type="homogeneous" name="interior"/></shape>'
    hole = '<shape type="sphere"><bsdf type="null"/><ref name="interior" id="e"/></shape>'
    text = f'<scene version="3.0.0"><integrator type="volpath"/>{SENSOR}{empty}{fog}{hole}</scene>'
    (tmp_path / "a.xml").write_text(text)
    assert load_scene_file(tmp_path / "a.xml").instances[1].interior == VACUUM


@pytest.mark.parametrize("around", [True, False])
@pytest.mark.parametrize("program", ["mitsuba", "luxcore"])
def test_light_is_not_absorbed_in_a_hole(program: str, around: bool, tmp_path: Path) -> None:
    """Of five units three absorb: in a medium around the camera, or in a block."""
    made = scene(FOG)
    if not around:
        stretched = at(-2.49)  # before the wall
        stretched[2, 2] = 2.5
        block = Instance(Cube(), NOTHING, stretched, interior=FOG)
        camera = dataclasses.replace(made.camera, to_world=at(1.0))
        made = dataclasses.replace(made, camera=camera, instances=(*made.instances, block), medium=None)
    wanted = np.exp(-3.0 * np.array(FOG.absorption))
    picture = drawn(made, program, tmp_path, 16, 256)[7:9, 7:9].mean(axis=(0, 1))
    np.testing.assert_allclose(picture, wanted, rtol=0.05)


def test_formats_without_media_do_not_lose_vacuum(tmp_path: Path) -> None:
    report = LossReport()
    save_scene_file(dataclasses.replace(scene(None), medium=None), tmp_path / "a.gltf", None, report)
    assert not [loss for loss in report.losses if loss.picture and "medium" in loss.what]


def test_a_missing_medium_of_a_sensor_is_vacuum(tmp_path: Path) -> None:
    sensor = SENSOR.replace("</sensor>", '<ref id="fog"/></sensor>')
    (tmp_path / "a.xml").write_text(f'<scene version="3.0.0"><integrator type="volpath"/>{sensor}</scene>')
    report = LossReport()
    assert load_scene_file(tmp_path / "a.xml", None, report).medium is None
    lost = [f"{loss.what}: {loss.became}" for loss in report.losses if loss.picture]
    assert lost == ["'fog', which no earlier element has as its name: vacuum"]


@pytest.mark.parametrize(("version", "scattering"), [("3", 9.0), ("4", 0.74)])
def test_presets_of_pbrt_beside_coefficients(version: str, scattering: float, tmp_path: Path) -> None:
    """Coefficients that are given count in version 3, the preset in version 4."""
    media = 'Integrator "volpath"\nMakeNamedMedium "fog" "string type" "homogeneous" {}\n'
    head = media.format('"string preset" "Skin1" "rgb sigma_s" [ 9 9 9 ]') + "WorldBegin\n"
    head += 'Material "diffuse"\n' if version == "4" else ""
    scene, _ = pbrt(tmp_path, 'MediumInterface "fog" ""\nShape "sphere"\n', head)
    assert scene.instances[0].interior.scattering[0] == scattering
    assert scene.instances[0].interior.absorption == (0.032, 0.17, 0.48)
