"""Scenes and formats of scene files that programs and installed packages add."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from scenes import catalog
from scenes.canonical import PerspectiveCamera, Scene, SceneError
from scenes.formats import FORMATS
from scenes.formats.conversion import format_of, load_scene_file, save_scene_file
from tsar.config import ConfigError

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = '''
"""Balls, a line each: x, y, z and radius."""
import numpy as np
from scenes.canonical import Instance, Matte, ConstantTexture, PerspectiveCamera, Scene, Sphere
from scenes.formats.text.format import Format

WHITE = Matte(ConstantTexture((1.0, 1.0, 1.0)))

def read(path, root, report):
    rows = [list(map(float, line.split())) for line in path.read_text().splitlines()]
    places = [np.eye(4) for _ in rows]
    for place, row in zip(places, rows):
        place[:3, 3] = row[:3]
    balls = [Instance(Sphere(row[3]), WHITE, place) for place, row in zip(places, rows)]
    return Scene(PerspectiveCamera(), tuple(balls), name=path.stem)

def write(scene, output, report):
    rows = [(*one.to_world[:3, 3], one.shape.radius) for one in scene.instances if isinstance(one.shape, Sphere)]
    output.text(output.path.name, "".join(" ".join(map(str, row)) + "\\n" for row in rows))

BALLS = Format("Balls", (".balls",), read, write)

def juggled(phase):
    return Scene(PerspectiveCamera(), (Instance(Sphere(1.0 + phase), WHITE),), name="juggled")
'''
POINTS = "[tsar.scene_formats]\nballs = balls:BALLS\n[tsar.scenes]\njuggled = balls:juggled\n"


@pytest.fixture(name="site")
def an_installed_package(tmp_path: Path) -> Path:
    """A folder with a package that brings a scene and a format, as an installer leaves it."""
    (tmp_path / "balls.py").write_text(PACKAGE)
    info = tmp_path / "balls-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: balls\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(POINTS)
    (info / "RECORD").write_text("balls.py,,\n")
    return tmp_path


def test_commands_take_the_scene_and_the_format_of_an_installed_package(site: Path) -> None:
    (site / "a.balls").write_text("0 0 -5 1\n1 0 -5 0.5\n")
    places = {**os.environ, "PYTHONPATH": f"{site}{os.pathsep}{ROOT}"}

    def run(*arguments: str) -> subprocess.CompletedProcess:
        command = [sys.executable, *arguments]
        return subprocess.run(command, cwd=site, env=places, capture_output=True, text=True, timeout=120)

    convert = str(ROOT / "scripts" / "convert.py")
    for source, target in (("a.balls", "b.pbrt"), ("b.pbrt", "c.balls")):
        done = run(convert, source, target)
        assert done.returncode == 0, done.stderr
    assert (site / "c.balls").read_text() == "0.0 0.0 -5.0 1.0\n1.0 0.0 -5.0 0.5\n"
    done = run(str(ROOT / "scripts" / "render.py"), "a.balls", "--explain")
    assert done.returncode == 0 and "sphere" in done.stdout, done.stdout + done.stderr
    done = run(convert, "a.balls", "b.lxss")
    assert done.returncode == 2
    assert ".ply, .stl, .balls, got '.lxss' (nearest: .lxs)" in " ".join(done.stderr.split())
    script = "from scenes.catalog import SCENES, load, load_any; "
    script += "print(len(load_any('a.balls')[0].instances), load('juggled', 0.5).instances[0].shape.radius); "
    script += "found = SCENES.origin('juggled'); print(found.module, found.distribution, found.version)"
    done = run("-c", script)
    assert done.stdout.splitlines() == ["2 1.5", "balls balls 1.0"], done.stderr


def test_a_scene_stands_where_a_name_is_taken() -> None:
    scene = Scene(PerspectiveCamera(), ())
    assert catalog.load(scene) is scene and catalog.load_any(scene) == (scene, ())
    with pytest.raises(SceneError, match=r"^phase: expected 0 for the scene given, which has no phases, got 0.5$"):
        catalog.load(scene, 0.5)
    with pytest.raises(SceneError, match=r"^camera_path: expected none for a scene that is given, got turntable$"):
        catalog.load_any(scene, camera_path="turntable")


def test_what_python_adds_is_found_by_name_and_ending(tmp_path: Path, monkeypatch) -> None:
    for table in (catalog.SCENES, FORMATS):
        monkeypatch.setattr(table, "_entries", dict(table._entries))
    scene = Scene(PerspectiveCamera(), (), name="mine")
    catalog.SCENES.add("mine", lambda phase: scene)
    assert catalog.load("mine") is scene and catalog.load_any("mine", 0.25) == (scene, ())
    held: dict[str, object] = {}
    exec(PACKAGE, held)
    FORMATS.add("balls", held["BALLS"])  # type: ignore[arg-type]
    save_scene_file(scene, tmp_path / "a.BALLS")
    assert load_scene_file(tmp_path / "a.BALLS").name == "a" and format_of(Path("a.balls")) == "balls"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: catalog.load("fly-bye"), "scene: expected one of corner-exit, .*, got 'fly-bye' (nearest: fly-by)"),
        (lambda: catalog.load_any("a.pbtr"), "a.pbtr: expected a name that ends in .*, got '.pbtr' (nearest: .pbrt)"),
        (lambda: catalog.load("glass", 0.5), "phase: expected 0 for the scene glass, which has no phases, got 0.5"),
        (
            lambda: save_scene_file(Scene(PerspectiveCamera(), ()), Path("a.xml"), "mitsubba"),
            "scene format: expected one of pbrt, .*, got 'mitsubba' (nearest: mitsuba)",
        ),
    ],
)
def test_what_is_not_known_names_what_is_and_the_nearest(call, message: str) -> None:
    with pytest.raises((SceneError, ConfigError)) as caught:
        call()
    start, _, end = message.partition(".*")
    assert str(caught.value).startswith(start) and str(caught.value).endswith(end)
