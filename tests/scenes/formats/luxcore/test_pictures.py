"""LuxCore's own scenes as LuxCore draws them, and as it and Mitsuba draw what they are converted to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from analysis.conversion.peers import rendered
from scenes.formats.conversion import load_scene_file, save_scene_file
from tests.scenes.formats.files import drawn, seen
from tests.scenes.formats.luxcore.test_read import CAMERA, SIMPLE

FLOOR = (
    "scene.materials.m.type = matte\nscene.materials.m.kd = 0.6 0.3 0.2\n"
    "scene.objects.o.vertices = -4 -4 0 4 -4 0 4 4 0 -4 4 0\nscene.objects.o.faces = 0 1 2 0 2 3\n"
    "scene.objects.o.uvs = 0 0 1 0 1 1 0 1\nscene.objects.o.material = m\n"
    "scene.objects.p.vertices = 0 0 0 1 0 0 0 0 1\nscene.objects.p.faces = 0 1 2\nscene.objects.p.material = m\n"
    "scene.objects.p.transformation = 1 0.5 0 0 -0.5 1 0 0 0 0 2 0 0.5 0.3 0.2 1\n"
)
POINT = "scene.lights.l.type = point\nscene.lights.l.position = 1 -2 3\nscene.lights.l.gain = 100 80 60\n"
CASES = {
    "wide": POINT + "scene.camera.fieldofview = 50\n",
    "window": POINT + "scene.camera.screenwindow = -0.5 1.1 -0.8 0.8\n",
    "parallel": POINT + "scene.camera.type = orthographic\nscene.camera.screenwindow = -4 4 -4 4\n",
    "spot with power": (
        "scene.lights.l.type = spot\nscene.lights.l.position = 0 0 3\nscene.lights.l.target = 0.5 0.5 0\n"
        "scene.lights.l.coneangle = 60\nscene.lights.l.conedeltaangle = 1\nscene.lights.l.color = 1 0.5 1\n"
        "scene.lights.l.power = 1\nscene.lights.l.efficency = 17\n"
    ),
    "distant": (
        "scene.lights.l.type = sharpdistant\nscene.lights.l.direction = 1 0.5 -2\nscene.lights.l.gain = 3 2 1\n"
        "scene.lights.e.type = constantinfinite\nscene.lights.e.color = 0.2 0.2 0.4\n"
    ),
    "checkerboard": POINT + "scene.materials.m.kd = t\n",
}
CHECKERBOARD = (
    "scene.textures.t.type = checkerboard2d\nscene.textures.t.texture1 = 0.8 0.1 0.1\n"
    "scene.textures.t.texture2 = 0.1 0.1 0.8\nscene.textures.t.mapping.uvscale = 4 4\n"
)


@pytest.mark.parametrize("name", CASES)
def test_converted_scenes_look_as_in_luxcore(name: str, tmp_path: Path) -> None:
    """The picture of the scene itself, and that of the converted one, where LuxRender lacks the camera by Mitsuba."""
    size = "film.width = 32\nfilm.height = 32\nscene.file = a.scn\n"
    (tmp_path / "a.cfg").write_text(size)
    (tmp_path / "a.scn").write_text(CAMERA + CHECKERBOARD + FLOOR + CASES[name])
    own = seen("luxcore", tmp_path / "a.cfg", 32, 64)
    other = drawn(
        load_scene_file(tmp_path / "a.cfg"), "mitsuba" if name == "parallel" else "luxcore", tmp_path, samples=64
    )
    np.testing.assert_allclose(other.mean((0, 1)), own.mean((0, 1)), rtol=0.02)
    assert np.abs(other - own).mean() < 0.05 * own.mean()


@pytest.mark.parametrize(("base", "coat"), [("0.5", "0.04"), ("0.5", "0.25"), ("0.5", "0.5"),
                                            ("0.75 0.1 0.1", "0.75 0.75 0.25")])  # fmt: skip
@pytest.mark.parametrize("eye", ["0.01 0 8", "0 -7 2.5"])
def test_glossy_surfaces_are_as_bright_in_mitsuba(base: str, coat: str, eye: str, tmp_path: Path) -> None:
    """A plane under an even sky, from above and from 20 degrees; without the base's correction up to 59 % darker."""
    (tmp_path / "a.cfg").write_text("film.width = 8\nfilm.height = 8\nscene.file = a.scn\n")
    (tmp_path / "a.scn").write_text(
        f"scene.camera.lookat.orig = {eye}\nscene.camera.lookat.target = 0 0 0\nscene.camera.up = 0 1 1\n"
        "scene.camera.fieldofview = 20\nscene.lights.l.type = constantinfinite\nscene.materials.m.type = glossy2\n"
        f"scene.materials.m.kd = {base}\nscene.materials.m.ks = {coat}\n"
        "scene.objects.o.vertices = -9 -9 0 9 -9 0 9 9 0 -9 9 0\nscene.objects.o.faces = 0 1 2 0 2 3\n"
        "scene.objects.o.material = m\n"
    )
    own = seen("luxcore", tmp_path / "a.cfg", 8, 64).mean((0, 1))
    found = drawn(load_scene_file(tmp_path / "a.cfg"), "mitsuba", tmp_path, 8, 64).mean((0, 1))
    print(f"base {base}, coat {coat}, from {eye}: {(found / own).round(3).tolist()}")
    np.testing.assert_allclose(found, own, rtol=0.08)


@pytest.mark.skipif(not SIMPLE.is_dir(), reason="the scene files are not beside this project")
def test_a_real_scene_looks_as_in_luxcore(tmp_path: Path) -> None:
    pytest.importorskip("pyluxcore")
    file = next(SIMPLE.rglob("simple.cfg"))
    save_scene_file(load_scene_file(file, SIMPLE), tmp_path / "b.lxs")
    own, other = (rendered("luxcore", source, tmp_path / "a.npy", (32, 24), 64, 300.0) for source in
                  (file, tmp_path / "b.lxs"))  # fmt: skip
    assert not isinstance(own, str) and not isinstance(other, str)
    np.testing.assert_allclose(other.mean((0, 1)), own.mean((0, 1)), rtol=0.03)
    assert np.abs(other - own).mean() < 0.05 * own.mean()
