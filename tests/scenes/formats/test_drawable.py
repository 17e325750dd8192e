"""Scenes of other renderers as ours draws them."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from renderer.frames import render_image
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from scenes import catalog
from scenes.animation import pose_at
from scenes.camera_paths import on_a_path
from scenes.canonical import (
    ConstantTexture,
    Cube,
    Disk,
    Emissive,
    EnvironmentLight,
    Glass,
    Glossy,
    Instance,
    Integrator,
    Masked,
    Matte,
    Metal,
    Mirror,
    MixMaterial,
    PerspectiveCamera,
    Phong,
    Rectangle,
    Scene,
    SceneError,
    Sphere,
    SunSky,
    Translucent,
)
from scenes.daylight import sun_light
from scenes.formats.appearance.spectra import METALS
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.drawable import DEPTH_MAX, drawable, spread_deg
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import DATA, MITSUBA, REAL, needs_data

GREY, WHITE = ConstantTexture((0.5, 0.5, 0.5)), ConstantTexture((1.0, 1.0, 1.0))


@needs_data
@pytest.mark.parametrize("name", [*REAL, *MITSUBA])
def test_every_real_scene_is_drawn(name: str) -> None:
    scene = drawable(load_scene_file(DATA / name, DATA / name.split("/")[0]), LossReport())
    renderer = Renderer(scene, specialise=False)
    image = render_image(renderer, SamplePlan(4), 24, 16, 0.0)
    renderer.close()
    assert np.isfinite(image.numpy()).all() and image.max() > 0.01


def test_what_is_replaced_is_reported_and_the_rest_is_the_same() -> None:
    gold = Metal(*METALS["Au"], (0.3, 0.3))
    parts = (
        Matte(GREY),
        gold,
        Glossy(GREY, ConstantTexture((0.04, 0.04, 0.04)), (0.1, 0.1)),
        Glass(roughness=(0.1, 0.1)),
        Translucent(GREY, GREY),
        MixMaterial(Matte(WHITE), Mirror(), ConstantTexture((0.7, 0.7, 0.7))),
        Masked(Matte(GREY), GREY),
    )
    instances = tuple(Instance(Sphere(), part, name=f"n{number}") for number, part in enumerate(parts))
    report = LossReport()
    scene = drawable(Scene(PerspectiveCamera(), instances, integrator=Integrator("path", 64)), report)
    found = [one.material for one in scene.instances]
    assert found[0] == Matte(GREY) and found[6] == Matte(GREY) and found[4] == Matte(GREY)
    assert isinstance(found[1], Mirror) and found[1].spread_deg == pytest.approx(math.degrees(4 * math.atan(0.3)))
    red, _, blue = found[1].reflectance.value  # type: ignore[union-attr]
    assert red > 0.9 and blue < 0.5
    assert isinstance(found[2], Phong) and found[2].exponent == pytest.approx(2.0 / 0.01 - 2.0)
    assert isinstance(found[3], Glass) and found[3].roughness == (0.0, 0.0) and found[3].spread_deg == spread_deg(0.1)
    assert found[5] == Mirror()
    assert scene.integrator.depth == DEPTH_MAX
    assert {loss.where for loss in report.losses} == {"integrator", "n1", "n2", "n3", "n4", "n5", "n6"}


def test_lamps_of_any_shape() -> None:
    lamps = tuple(
        Instance(shape, Matte(GREY), emission=(2.0, 2.0, 2.0)) for shape in (Rectangle(), Disk(2.0), as_mesh(Disk()))
    )
    report = LossReport()
    square, round_one, meshed = drawable(Scene(PerspectiveCamera(), lamps), report).instances
    assert square.shape == Rectangle() and square.emission == (2.0, 2.0, 2.0)
    assert isinstance(round_one.shape, Rectangle)
    assert 4.0 * np.prod(np.diag(round_one.to_world)[:2]) == pytest.approx(math.pi * 4.0)
    assert meshed.material == Emissive((2.0, 2.0, 2.0)) and meshed.emission is None
    assert len(report.losses) == 2


def test_daylight_becomes_a_wide_light_and_a_map() -> None:
    report = LossReport()
    sun = SunSky((0.0, 1.0, 0.0), part="sun", up=(0.0, 1.0, 0.0))
    scene = drawable(Scene(PerspectiveCamera(), (), (sun, dataclasses.replace(sun, part="both"))), report)
    assert scene.lights[0] == scene.lights[1] == sun_light(sun)
    assert isinstance(scene.lights[2], EnvironmentLight) and len(report.losses) == 1


def test_the_turntable_keeps_what_is_looked_at_in_place() -> None:
    """Four metres ahead, whatever the time; after a quarter of a turn seen from the side; after all of it as before."""
    scene = Scene(PerspectiveCamera(np.eye(4)), (Instance(Sphere(), Matte(GREY), as_place(0.0, 0.0, -4.0)),))
    moved = on_a_path(scene, "turntable")
    track = moved.camera.track  # type: ignore[union-attr]
    for time_s, eye in ((0.0, (0, 0, 0)), (2.0, (4, 0, -4)), (4.0, (0, 0, -8)), (8.0, (0, 0, 0))):
        matrix = pose_at(track, time_s) @ moved.camera.to_world
        np.testing.assert_allclose(matrix[:3, 3], eye, atol=1e-6)
        np.testing.assert_allclose(matrix[:3, 3] - 4.0 * matrix[:3, 2], (0, 0, -4), atol=1e-6)


def as_place(x: float, y: float, z: float) -> np.ndarray:
    """A shift."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def test_paths_are_for_cameras_that_stand_still() -> None:
    scene = Scene(PerspectiveCamera(), (Instance(Sphere(), Matte(GREY), as_place(0.0, 0.0, -4.0)),))
    flight = on_a_path(scene, "fly-through")
    assert flight.camera.track is not None  # type: ignore[union-attr]
    np.testing.assert_allclose(flight.camera.track.translation[32], (0, 0, -2), atol=1e-9)  # type: ignore[union-attr]
    with pytest.raises(SceneError, match="this one moves"):
        on_a_path(flight, "turntable")
    with pytest.raises(SceneError, match="expected none for a built-in scene"):
        catalog.load_any("fly-by", 0.0, "turntable")


@needs_data
def test_direct_light_is_mitsubas_to_the_noise(tmp_path: Path) -> None:
    """Z-test of blocks of pixels: the Cornell box lit by its lamp alone, twelve independent pictures of each."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    scene = load_scene_file(DATA / "pbrt/cornell-box/scene.pbrt")
    film = dataclasses.replace(scene.film, filter="box", filter_radius_px=0.5, width_px=32, height_px=32)
    scene = dataclasses.replace(scene, film=film, integrator=Integrator("direct", 1))
    save_scene_file(scene, tmp_path / "box.xml", "mitsuba3")
    other = mi.load_file(str(tmp_path / "box.xml"))
    theirs = [blocks(np.array(mi.render(other, spp=32, seed=seed))[..., :3]) for seed in range(12)]
    ours = []
    for seed in range(12):
        renderer = Renderer(drawable(scene, LossReport()), specialise=False, seed=seed)
        ours.append(blocks(render_image(renderer, SamplePlan(32, "random", seed), 32, 32, 0.0).numpy()))
        renderer.close()
    a, b = np.array(ours), np.array(theirs)
    noise = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / 12)
    z = (a.mean(axis=0) - b.mean(axis=0)) / np.maximum(noise, 1e-9)
    seen = b.mean(axis=0) > 1e-4
    assert np.abs(a.mean() / b.mean() - 1.0) < 0.01
    assert 0.6 < z[seen].std() < 1.5 and (np.abs(z[seen]) > 4.0).mean() < 0.02


def blocks(image: np.ndarray) -> np.ndarray:
    """Means of 4 x 4 pixels, without those that see the lamp."""
    return np.minimum(image, 2.0).reshape(8, 4, 8, 4, 3).mean(axis=(1, 3))


@needs_data
def test_tsar_runs_on_a_file_with_a_turntable(tmp_path: Path, monkeypatch, capsys) -> None:
    from tests.scripts.commands import call_script

    file = str(DATA / "mitsuba/cornell-box/scene.xml")
    size = (
        "--seconds",
        "0.1",
        "--resolution-px",
        "64",
        "--batch-size",
        "16",
        "--capacity",
        "8.7e10",
        "--no-film",
        "--rivals",
        "framed",
        "thesis",
    )
    folders = ("--out", str(tmp_path / "out"), "--references", str(tmp_path / "cache"))
    status = call_script("run.py", monkeypatch, file, "--camera-path", "turntable", *size, *folders)
    assert status == 0, capsys.readouterr().err
    found = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert found["invariants"]["ok"] and found["cycles"] > 2
    assert "light between surfaces: direct light, mirrors, glass" in capsys.readouterr().out


def test_a_cube_that_shines_is_six_rectangles_facing_outwards() -> None:
    report = LossReport()
    place = np.diag([1.0, 2.0, 3.0, 1.0]) @ as_place(0.5, 0.0, 0.0)
    lamp = Instance(Cube(), Matte(GREY), place, emission=(1.0, 2.0, 3.0))
    sides = drawable(Scene(PerspectiveCamera(), (lamp,)), report).instances
    assert len(sides) == 6 and not report.losses and all(isinstance(side.shape, Rectangle) for side in sides)
    total = 0.0
    for side in sides:
        axes = side.to_world[:3, :3]
        normal = np.cross(axes[:, 0], axes[:, 1])
        assert normal @ (side.to_world[:3, 3] - place[:3, 3]) > 0.0 and side.emission == (1.0, 2.0, 3.0)
        total += 4.0 * float(np.linalg.norm(normal))
    assert total == pytest.approx(8.0 * (2.0 + 3.0 + 6.0))


@pytest.mark.parametrize(("edges", "depth"), [(2, 0), (3, 1), (-1, -1)])
def test_paths_have_as_many_edges_as_the_file_allows(edges: int, depth: int, tmp_path: Path) -> None:
    """Two edges to the light are direct light, which is a depth of 0 here. A model has no limit of its own."""
    file = tmp_path / "in.xml"
    limit = f'<integrator type="path"><integer name="maxDepth" value="{edges}"/></integrator>'
    file.write_text(f'<scene version="0.5.0">{limit}<sensor type="perspective"/><shape type="sphere"/></scene>')
    assert catalog.load_any(str(file), integrator="path")[0].integrator.depth == depth
    plain = drawable(Scene(PerspectiveCamera(), ()), LossReport(), "path")
    assert plain.integrator.depth == Scene(PerspectiveCamera(), ()).integrator.depth
