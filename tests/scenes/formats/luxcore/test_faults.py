"""LuxCore's own scenes with faults, and with properties that are spelled otherwise."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenes.canonical import SceneError
from tests.scenes.formats.luxcore.test_read import CAMERA, SQUARE, scene_of

FULL = (
    CAMERA + "scene.textures.f.type = fresnelconst\nscene.textures.f.n = 1 2 3\nscene.camera.fieldofview = 60\n"
    "scene.camera.lensradius = 0.1\nscene.textures.t.type = constfloat3\n"
    "scene.textures.t.value = 0.1 0.2 0.3\nscene.materials.m.type = glossy2\nscene.materials.m.kd = t\n"
    "scene.materials.m.ks = 0.2\nscene.materials.m.multibounce = 0\nscene.materials.m.uroughness = 0.2\n"
    "scene.materials.m.emission = 1\n" + SQUARE + "scene.objects.o.transformation = 1 0 0 0 0 1 0 0 0 0 1 0 1 2 3 1\n"
    "scene.lights.l.type = point\nscene.lights.l.gain = 2\nscene.lights.l.position = 1 2 3\n"
)


@pytest.mark.parametrize("line", range(FULL.count("\n")))
def test_no_property_changes_in_silence(line: int, tmp_path: Path) -> None:
    """A key that is spelled otherwise is an error or a loss, whichever property it is."""
    lines = FULL.splitlines()
    key, _, value = lines[line].partition(" = ")
    lines[line] = f"{key}x = {value}"
    try:
        _, report = scene_of(tmp_path, "\n".join(lines))
    except SceneError as error:
        assert "\n" not in str(error)
        return
    assert any(loss.picture for loss in report.losses), lines[line]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("scene.camera.type perspective", "a.scn:1:1: expected a property such as"),
        ("scene.camera.fieldofview = wide", "fov: expected numbers"),
        ("scene.camera.fieldofview = nan", "a.scn:1:28: expected numbers up to 1e"),
        ("scene.camera.fieldofview = 1e99", "a.scn:1:28: expected numbers up to 1e"),
        ("scene.camera.lookat.orig = 1 2", "expected 3 numbers, got 2"),
        ("scene.camera.lookat.orig = 0 0 0", "LookAt: expected an upward direction"),
        ("scene.camera.type =", "expected a property"),
        ("scene.objects.o.vertices = 0 0 0", "expected a property material, found none"),
        (SQUARE.replace("0 2 3", "0 2 9"), "a.scn"),
        (SQUARE + "scene.objects.o.transformation = " + "0 " * 16, "expected a matrix that can be inverted"),
        ("scene.objects.o.ply = ../a.ply\nscene.objects.o.material = m", "expected a file inside"),
        ("scene.objects.o.ply = /etc/passwd\nscene.objects.o.material = m", "expected a relative file name"),
        ("scene.lights.l.type = point\nscene.lights.l.gain = 1 2", "expected 1 or 3 numbers, got 2"),
        ("", "expected properties of LuxCore"),
    ],
)
def test_faults_are_one_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError) as error:
        scene_of(tmp_path, text)
    assert message in str(error.value) and "\n" not in str(error.value)


def test_configurations_name_a_scene(tmp_path: Path) -> None:
    for text, message in (
        ("film.width = 10", "expected a configuration of LuxCore with a property scene.file"),
        ("scene.file = a.cfg", "expected another file"),
        ("scene.file = c.scn", "expected a file at"),
        ("scene.file = b.cfg", "expected a scene, got a configuration"),
    ):
        (tmp_path / "b.cfg").write_text("scene.file = a.cfg")
        with pytest.raises(SceneError, match=message):
            scene_of(tmp_path, text, "a.cfg")
