"""Cameras and configurations of LuxCore."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import Film, Integrator, OrthographicCamera, PerspectiveCamera, Sampler
from tests.scenes.formats.luxcore.test_read import CAMERA, scene_of


def test_camera(tmp_path: Path) -> None:
    """Without a window the longer side is from -1 to 1, along which the angle is measured."""
    (tmp_path / "b.scn").write_text(CAMERA + "scene.camera.fieldofview = 60\nscene.camera.lensradius = 0.1\n"
                                    "scene.camera.focaldistance = 7\nscene.camera.up = 0 0 1\n")  # fmt: skip
    text = "scene.file = b.scn\nfilm.width = 200\nfilm.height = 100\n"
    camera = scene_of(tmp_path, text, "a.cfg")[0].camera
    assert isinstance(camera, PerspectiveCamera)
    assert camera.fov_deg == pytest.approx(2.0 * math.degrees(math.atan(0.5 * math.tan(math.radians(30.0)))))
    assert (camera.lens_radius, camera.focal_distance) == (0.1, 7.0)
    np.testing.assert_allclose(camera.to_world[:3, 3], (1.0, -8.0, 5.0))
    toward = np.array((-1.0, 8.0, -4.5))
    np.testing.assert_allclose(-camera.to_world[:3, 2], toward / np.linalg.norm(toward))
    tall = scene_of(tmp_path, text.replace("200", "50"), "a.cfg")[0].camera
    assert isinstance(tall, PerspectiveCamera) and tall.fov_deg == pytest.approx(camera.fov_deg)


def test_parallel_camera(tmp_path: Path) -> None:
    window = "scene.camera.type = orthographic\nscene.camera.screenwindow = -4 4 -3 3\n"
    scene, report = scene_of(tmp_path, CAMERA + window)
    assert isinstance(scene.camera, OrthographicCamera) and scene.camera.half_width == 3.0 and not report.losses


def test_configuration(tmp_path: Path) -> None:
    (tmp_path / "b.scn").write_text(CAMERA)
    text = (
        "scene.file = b.scn\nfilm.width = 320\nfilm.height = 240\nfilm.filter.type = MITCHELL\n"
        "film.filter.width = 1.5\n"
        "path.pathdepth.total = 9\nrenderengine.type = PATHOCL\nsampler.type = SOBOL\nbatch.haltspp = 40\n"
        "film.outputs.1.type = RGB\npath.clamping.variance.maxvalue = 10\npath.pathdepth.diffuse = 8\n"
        "path.pathdepth.glossy = 9\n"
    )
    scene, report = scene_of(tmp_path, text, "a.cfg")
    assert scene.film == Film(320, 240, "mitchell", 1.5)
    assert scene.integrator == Integrator("path", 8) and scene.sampler == Sampler("sobol", 40)
    lost = {loss.what: loss.picture for loss in report.losses}
    hints = {"sampler 'sobol'": False, "property 'film.outputs.1.type'": False}
    changes = ("property 'path.clamping.variance.maxvalue'", "at most 8 diffuse bounces", "at most 6 specular bounces")
    assert lost == {**hints, **dict.fromkeys(changes, True)}
    scene, report = scene_of(tmp_path, text.replace("PATHOCL", "BIDIRCPU").replace("MITCHELL", "CATMULLROM"), "a.cfg")
    assert scene.integrator.kind == "bidirectional"
    assert "filter 'CATMULLROM'" in [loss.what for loss in report.losses]


@pytest.mark.parametrize(
    ("text", "depth", "limits"),
    [
        ("", 5, 2),
        ("path.maxdepth = 9", 8, 0),
        ("path.maxdepth = 9\npath.pathdepth.total = 4", 3, 0),
        ("renderengine.type = BIDIRCPU\npath.pathdepth.total = 9", 4, 0),
    ],
)
def test_depths_are_those_of_luxcore(text: str, depth: int, limits: int, tmp_path: Path) -> None:
    """LuxCore 2.10 has 6 for all bounces and 4 for diffuse and glossy ones, unless a file has ``path.maxdepth`` alone;
    its bidirectional engines have 5."""
    (tmp_path / "b.scn").write_text(CAMERA)
    scene, report = scene_of(tmp_path, f"scene.file = b.scn\nfilm.filter.type = NONE\n{text}\n", "a.cfg")
    assert scene.integrator.depth == depth
    assert len(report.losses) == limits and all("bounces" in loss.what for loss in report.losses)
