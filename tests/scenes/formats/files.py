"""Scene files that tests read: real ones where they are beside this project, delivered ones, and texts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from analysis.conversion.peers import rendered
from scenes.canonical import Scene
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from scenes.loading import ASSETS

DATA = Path(__file__).resolve().parents[4] / "shared" / "data" / "scenes"
REAL = sorted(
    path.relative_to(DATA).as_posix()
    for path in [*DATA.glob("pbrt/**/*.pbrt"), *DATA.glob("luxrender/**/*.lxs")]
    if path.name != "cube.pbrt"  # part of others
)
HEAD = 'LookAt 0 0 5 0 0 0 0 1 0\nCamera "perspective"\nWorldBegin\n'
MESH = 'Shape "trianglemesh" "integer indices"'
MITSUBA = sorted(path.relative_to(DATA).as_posix() for path in DATA.glob("mitsuba/**/*.xml"))
DELIVERED = ASSETS / "cornell-box"
CASES = Path(__file__).parent / "cases"
SENSOR = '<sensor type="perspective"><float name="fov" value="40"/></sensor>'
needs_data = pytest.mark.skipif(not REAL, reason="the scene files are not beside this project")


def pbrt(folder: Path, body: str, head: str = HEAD, name: str = "a.pbrt"):
    """The scene of a text, and what it lost."""
    (folder / name).write_text(head + body)
    report = LossReport()
    return load_scene_file(folder / name, None, report), [str(loss) for loss in report.losses]


def real(name: str, report: LossReport | None = None):
    return load_scene_file(DATA / name, DATA / name.split("/")[0], report)


def mitsuba(folder: Path, body: str, sensor: str = SENSOR):
    """The same of a Mitsuba text."""
    (folder / "a.xml").write_text(f'<scene version="0.5.0">\n{sensor}\n{body}</scene>')
    report = LossReport()
    return load_scene_file(folder / "a.xml", None, report), [str(loss) for loss in report.losses]


def case(name: str, file: str = "scene.pbrt") -> tuple[Scene, list[str]]:
    """The scene of a case, and what it lost."""
    report = LossReport()
    return load_scene_file(CASES / name / file, None, report), [str(loss) for loss in report.losses]


def reflectances(scene: Scene) -> list[tuple[float, ...]]:
    return [one.material.reflectance.value for one in scene.instances]  # type: ignore[union-attr]


def seen(program: str, file: Path, size: int | tuple[int, int], samples: int) -> np.ndarray:
    pytest.importorskip({"mitsuba": "mitsuba", "luxcore": "pyluxcore"}[program])
    shape_px = size if isinstance(size, tuple) else (size, size)
    picture = rendered(program, file, file.with_suffix(".npy"), shape_px, samples, 300.0)
    assert not isinstance(picture, str), picture
    return picture


def drawn(scene: Scene, program: str, folder: Path, size: int | tuple[int, int] = 32, samples: int = 16) -> np.ndarray:
    to, ending = {"mitsuba": ("mitsuba3", ".xml"), "luxcore": ("luxrender", ".lxs")}[program]
    save_scene_file(scene, folder / f"a{ending}", to)
    return seen(program, folder / f"a{ending}", size, samples)
