"""Imports that each room may use. Reads the source; runs nothing."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("tsar", "renderer", "scenes", "analysis", "scripts")

RECORDS = tuple(f"tsar.{name}" for name in "checks choices config lazy memory morton named threads types".split())
CANONICAL = ("scenes.canonical", "scenes.arithmetic")
POSED = (*CANONICAL, "scenes.animation")
SHARED = tuple(f"scenes.formats.{room}" for room in ("text", "geometry", "appearance", "losses"))
BESIDE = tuple(f"scenes.{name}" for name in "animation arithmetic daylight loading models pictures viewing".split())
MEASURED = tuple(f"analysis.{room}" for room in ("command", "storage", "metrics", "page"))
DIALECTS = ("pbrt", "luxrender", "mitsuba", "blocks", "gltf", "usd")
OTHERS = ("renderer", "scenes", "tsar")
QUESTIONS = (
    "comparison suitability ablation trade precision sensitivity spectrum cost_report conversion bench tracer "
    "perception workloads live"
).split()

# What the modules of a room may import of the project, beside the room itself. A room that is not named has the rule of
# the nearest folder above it that is.
ROOMS: dict[str, tuple[str, ...]] = {
    "tsar": ("tsar",),
    "renderer/compute": RECORDS,
    "renderer/layout": ("renderer.compute",),
    "renderer/kernels": ("renderer.compute", "renderer.layout"),
    "renderer/tables": (*(f"renderer.{room}" for room in ("compute", "layout", "kernels")), *POSED, *RECORDS),
    "renderer/stages": ("renderer.compute", "tsar"),
    "renderer/sampling": (*RECORDS, "scenes.arithmetic"),
    "renderer/rays": ("renderer.compute", "renderer.layout", "renderer.kernels", "renderer.tables"),
    "renderer/film": ("scenes.arithmetic",),
    "renderer": ("renderer", *CANONICAL, *RECORDS),
    "renderer/render": ("renderer", "scenes", *RECORDS),
    "scenes/canonical": ("scenes.arithmetic",),
    "scenes/driving": ("scenes.canonical", *BESIDE),
    "scenes/effects": ("scenes.canonical", "scenes.driving", *BESIDE),
    **{
        f"scenes/formats/{room}": ("scenes.canonical", *SHARED, *BESIDE)
        for room in ("text", "geometry", "appearance", "directives")
    },
    **{
        f"scenes/formats/{dialect}": ("scenes.canonical", *SHARED, "scenes.formats.directives", *BESIDE)
        for dialect in DIALECTS
    },
    "scenes/formats/luxcore": (
        "scenes.canonical",
        *SHARED,
        "scenes.formats.directives",
        "scenes.formats.luxrender",
        *BESIDE,
    ),
    "scenes": ("scenes", "tsar.named"),
    "analysis/command": RECORDS,
    "analysis/storage": ("analysis.command", *RECORDS),
    "analysis/metrics": ("analysis.command", "analysis.storage", *RECORDS, "tsar.policy"),
    "analysis/page": ("analysis.command", "analysis.storage", "analysis.metrics", *RECORDS),
    "analysis/study": (*MEASURED, "renderer", "scenes", "tsar"),
    **{
        f"analysis/{room}": (*MEASURED, "analysis.study", "analysis.comparison", "analysis.tracer", *OTHERS)
        for room in QUESTIONS
    },
    "analysis": ("analysis", "renderer", "scenes", "tsar"),
    "scripts": ("analysis",),
}

STARTS_WARP = "renderer/compute/device.py"
USE_WARP = ("renderer", "scripts")
VAGUE_NAMES = {"utils", "util", "helpers", "helper", "common", "manager", "managers", "misc"}
MOST_LINES = 300


def within(name: str, packages: tuple[str, ...]) -> bool:
    return any(name == package or name.startswith(f"{package}.") for package in packages)


def imports(tree: ast.AST, path: str) -> Iterator[tuple[int, str]]:
    """Line and dotted name of everything that is imported, wherever in the file it stands."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            package = path.split("/")[: -node.level] if node.level else []
            base = ".".join([*package, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)


def starts_of_warp(tree: ast.AST) -> Iterator[int]:
    """Lines that call ``warp.init`` by any name, or import it alone."""
    names = {"warp"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.asname for alias in node.names if alias.name == "warp" and alias.asname}
        elif isinstance(node, ast.ImportFrom) and node.module == "warp":
            yield from (node.lineno for alias in node.names if alias.name == "init")
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "init":
            if isinstance(node.func.value, ast.Name) and node.func.value.id in names:
                yield node.lineno


def rule(path: str) -> tuple[str, tuple[str, ...]]:
    """The room that a file is in, or the file itself where it has a rule of its own, and what it may import."""
    room = path.removesuffix(".py")
    while room not in ROOMS:
        room = room.rpartition("/")[0]
    return room, ROOMS[room]


def violations(path: str, source: str) -> list[str]:
    """The rules that a file breaks, a line each; ``path`` is relative to the root, with forward slashes."""
    tree, found = ast.parse(source), []
    room, allowed = rule(path)
    for line, name in imports(tree, path):
        own = room.replace("/", ".")
        if within(name, PACKAGES) and not within(name, (own, *allowed)):
            found.append(f"{path}:{line} imports {name}")
        if within(name, ("warp",)) and path.split("/")[0] not in USE_WARP:
            found.append(f"{path}:{line} imports {name}")
    if path != STARTS_WARP:
        found += [f"{path}:{line} starts Warp" for line in starts_of_warp(tree)]
    found += [f"{path}: {part!r} says nothing" for part in Path(path).with_suffix("").parts if part in VAGUE_NAMES]
    return found


def sources(package: str) -> list[Path]:
    return [path for path in sorted((ROOT / package).rglob("*.py")) if "__pycache__" not in path.parts]


@pytest.mark.parametrize("package", PACKAGES)
def test_rooms_keep_to_their_side(package: str) -> None:
    files = sources(package)
    assert files, f"{package}: no source found"
    broken = [
        line
        for file in files
        for line in violations(file.relative_to(ROOT).as_posix(), file.read_text(encoding="utf-8"))
    ]
    assert not broken, "\n".join(broken)


def test_every_rule_is_of_a_room() -> None:
    assert not [room for room in ROOMS if not (ROOT / room).is_dir() and not (ROOT / f"{room}.py").is_file()]


def test_no_file_is_long() -> None:
    packages = (*PACKAGES, "tests", "docs")
    headers, pages = (ROOT / "renderer").rglob("*.h"), (ROOT / "analysis").rglob("*.js")
    files = [*headers, *pages, *(file for package in packages for file in sources(package))]
    lines = {file.relative_to(ROOT).as_posix(): len(file.read_text(encoding="utf-8").splitlines()) for file in files}
    assert not {name: count for name, count in lines.items() if count > MOST_LINES}


def test_warp_is_started_in_one_place() -> None:
    assert list(starts_of_warp(ast.parse((ROOT / STARTS_WARP).read_text(encoding="utf-8"))))


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("tsar/a.py", "import warp as wp"),
        ("tsar/response/a.py", "def f():\n    from renderer.trace import Renderer"),
        ("tsar/a.py", "if TYPE_CHECKING:\n    import scenes.canonical"),
        ("tsar/a.py", "from analysis import metrics"),
        ("tsar/a.py", "import scripts.run"),
        ("renderer/a.py", "import analysis"),
        ("renderer/film/a.py", "from analysis.storage.files import atomic"),
        ("renderer/a.py", "import numpy, scripts.run"),
        ("renderer/a.py", "from scenes import catalog"),
        ("renderer/kernels/a.py", "from scenes.canonical import Scene"),
        ("renderer/kernels/a.py", "from renderer.tables import buffers"),
        ("renderer/compute/a.py", "from renderer.layout.structs import Camera"),
        ("renderer/stages/a.py", "from scenes.canonical import Scene"),
        ("renderer/tables/a.py", "from renderer.trace import Renderer"),
        ("scenes/a.py", "from renderer import trace"),
        ("scenes/a.py", "import tsar.types"),
        ("scenes/canonical/a.py", "from scenes.loading import read_image"),
        ("scenes/formats/a.py", "from ...analysis import x"),
        ("scenes/formats/luxrender/a.py", "from scenes.formats.pbrt.read import read"),
        ("scenes/formats/text/a.py", "from scenes.formats.conversion import convert"),
        ("scenes/formats/geometry/a.py", "from scenes.formats.directives.syntax import Directive"),
        ("scenes/formats/directives/a.py", "from scenes.formats.pbrt.read import read"),
        ("analysis/storage/a.py", "from renderer.film.files import write_exr"),
        ("analysis/storage/a.py", "from analysis.study.cases import Case"),
        ("analysis/page/a.py", "from scenes import catalog"),
        ("analysis/metrics/a.py", "from tsar.selection import select"),
        ("analysis/command/a.py", "from analysis.storage.files import atomic"),
        ("analysis/study/a.py", "from analysis.comparison.experiment import run_experiment"),
        ("analysis/comparison/a.py", "from analysis.suitability.runs import runs"),
        ("analysis/comparison/experiment.py", "import warp"),
        ("renderer/trace.py", "import warp as wp\nwp.init()"),
        ("renderer/trace.py", "import warp\ndef f():\n    warp.init()"),
        ("scripts/a.py", "from warp import init"),
        ("scripts/a.py", "from renderer.trace import Renderer"),
        ("analysis/a.py", "from scripts.run import main"),
        ("renderer/utils.py", ""),
        ("scenes/common/a.py", ""),
        ("analysis/manager.py", ""),
        ("tsar/helpers.py", ""),
    ],
)
def test_violations_are_found(path: str, source: str) -> None:
    assert violations(path, source)


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("tsar/policies/afr.py", "import torch\nfrom tsar.cache import FrameletCache"),
        ("tsar/warping.py", "import warping\nfrom sceneslike import renderer"),
        ("renderer/trace.py", "import warp as wp\nfrom scenes.canonical import Scene\nfrom tsar.types import Tiling"),
        ("renderer/compute/device.py", "import warp as wp\nwp.init()"),
        ("renderer/trace.py", "import other as wp\nwp.init()\nself.init()"),
        ("renderer/stages/control.py", "from tsar.selection import select\nfrom renderer.compute import device"),
        (
            "analysis/page/video.py",
            "from tsar import types\nfrom tsar.types import Tiling\nfrom analysis import metrics",
        ),
        ("analysis/comparison/experiment.py", "import tsar.policy\nfrom renderer import trace"),
        ("analysis/study/evaluation.py", "from tsar.policy import run\nfrom renderer.trace import Renderer"),
        ("scripts/run.py", "import analysis.comparison.experiment"),
        ("scenes/driving/world.py", "from scenes.driving import meshing\nfrom . import animation"),
    ],
)
def test_what_is_allowed_passes(path: str, source: str) -> None:
    assert violations(path, source) == []
