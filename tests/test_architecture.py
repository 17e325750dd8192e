"""Who may import whom. Reads the source; runs nothing."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("tsar", "renderer", "analysis", "scenes", "scripts")

FORBIDDEN = {
    "tsar": ("warp", "renderer", "analysis", "scenes", "scripts"),
    "renderer": ("analysis", "scripts"),
    "scenes": ("warp", "renderer", "analysis", "tsar", "scripts"),
    "analysis": ("warp", "renderer", "scenes", "scripts"),
    "scripts": ("warp",),
}

# these wire packages together: what they may import beside the above
WIRING = {
    "analysis/accelerators.py": ("renderer", "scenes"),
    "analysis/bench_conversion.py": ("scenes",),
    "analysis/bench_cycles.py": ("renderer", "tsar"),
    "analysis/bench_features.py": ("renderer", "scenes"),
    "analysis/bench_mitsuba.py": ("scenes",),
    "analysis/bench_mitsuba_scene.py": ("scenes",),
    "analysis/bench_overhead.py": ("tsar",),
    "analysis/bench_rays.py": ("renderer", "scenes"),
    "analysis/bench_run.py": ("renderer",),
    "analysis/bench_scenes.py": ("renderer", "scenes"),
    "analysis/bench_shading.py": ("renderer", "scenes"),
    "analysis/bench_threads.py": ("renderer", "scenes"),
    "analysis/conversion_check.py": ("renderer", "scenes"),
    "analysis/conversion_markers.py": ("renderer", "scenes"),
    "analysis/cost_measurement.py": ("renderer", "scenes", "tsar"),
    "analysis/estimate_check.py": ("tsar",),
    "analysis/evaluation.py": ("renderer", "scenes"),
    "analysis/experiment.py": ("renderer", "scenes"),
    "analysis/policy_runs.py": ("renderer", "tsar"),
    "analysis/gallery.py": ("renderer", "scenes"),
    "analysis/ideal_density.py": ("tsar",),
    "analysis/jobs.py": ("renderer", "scenes"),
    "analysis/perception/stimuli.py": ("renderer",),
    "analysis/point_sets.py": ("renderer", "scenes"),
    "analysis/spectrum.py": ("renderer", "scenes", "tsar"),
    "analysis/tiles.py": ("renderer", "scenes"),
    "analysis/spectrum_study.py": ("scenes",),
    "analysis/stills.py": ("renderer",),
}

# the other modules of the analysis read what the pipeline hands out and run none of its stages
ANALYSIS_OF_TSAR = (
    "tsar.types", "tsar.config", "tsar.morton", "tsar.memory", "tsar.named", "tsar.policy", "tsar.policies",
)  # fmt: skip

STARTS_WARP = "renderer/device.py"
VAGUE_NAMES = {"utils", "util", "helpers", "helper", "common", "manager", "managers", "misc"}


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


def violations(path: str, source: str) -> list[str]:
    """What a file breaks, a line each; ``path`` is relative to the root, with forward slashes."""
    package, tree, found = path.split("/")[0], ast.parse(source), []
    for line, name in imports(tree, path):
        allowed = WIRING.get(path, ())
        stage = package == "analysis" and within(name, ("tsar",)) and not within(name, ANALYSIS_OF_TSAR)
        if (within(name, FORBIDDEN[package]) or stage) and not within(name, allowed):
            found.append(f"{path}:{line} imports {name}")
    if path != STARTS_WARP:
        found += [f"{path}:{line} starts Warp" for line in starts_of_warp(tree)]
    found += [f"{path}: {part!r} says nothing" for part in Path(path).with_suffix("").parts if part in VAGUE_NAMES]
    return found


def sources(package: str) -> list[Path]:
    return [path for path in sorted((ROOT / package).rglob("*.py")) if "__pycache__" not in path.parts]


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_keep_to_their_side(package: str) -> None:
    files = sources(package)
    assert files, f"{package}: no source found"
    broken = [
        line
        for file in files
        for line in violations(file.relative_to(ROOT).as_posix(), file.read_text(encoding="utf-8"))
    ]
    assert not broken, "\n".join(broken)


def test_warp_is_started_in_one_place() -> None:
    assert list(starts_of_warp(ast.parse((ROOT / STARTS_WARP).read_text(encoding="utf-8"))))


def test_wiring_modules_are_the_only_way_from_the_analysis_to_the_renderer() -> None:
    """Without its permission the wiring would be found: the permission is not idle."""
    source = (ROOT / "analysis/experiment.py").read_text(encoding="utf-8")
    found = violations("analysis/elsewhere.py", source)
    assert any("imports renderer" in line for line in found) and any("imports scenes" in line for line in found)


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("tsar/a.py", "import warp as wp"),
        ("tsar/response/a.py", "def f():\n    from renderer.trace import Renderer"),
        ("tsar/a.py", "if TYPE_CHECKING:\n    import scenes.canonical"),
        ("tsar/a.py", "from analysis import quality"),
        ("tsar/a.py", "import scripts.run"),
        ("renderer/a.py", "import analysis"),
        ("renderer/a.py", "from analysis.files import atomic"),
        ("renderer/a.py", "import numpy, scripts.run"),
        ("scenes/a.py", "from renderer import trace"),
        ("scenes/a.py", "import tsar.types"),
        ("scenes/formats/a.py", "from ...analysis import x"),
        ("analysis/results.py", "from renderer.film import write_exr"),
        ("analysis/results.py", "from scenes import catalog"),
        ("analysis/results.py", "from tsar import selection"),
        ("analysis/results.py", "from tsar.selection import select"),
        ("analysis/results.py", "import tsar"),
        ("analysis/suitability.py", "from renderer.trace import Renderer"),
        ("analysis/experiment.py", "import warp"),
        ("renderer/trace.py", "import warp as wp\nwp.init()"),
        ("renderer/trace.py", "import warp\ndef f():\n    warp.init()"),
        ("scripts/a.py", "from warp import init"),
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
        ("tsar/selection.py", "import torch\nfrom tsar.cache import FrameletCache"),
        ("tsar/warping.py", "import warping\nfrom sceneslike import renderer"),
        ("renderer/trace.py", "import warp as wp\nfrom scenes.canonical import Scene\nfrom tsar.types import Tiling"),
        ("renderer/device.py", "import warp as wp\nwp.init()"),
        ("renderer/trace.py", "import other as wp\nwp.init()\nself.init()"),
        ("analysis/compare.py", "from tsar import types\nfrom tsar.types import Tiling\nfrom analysis import quality"),
        ("analysis/experiment.py", "import tsar.policy\nfrom renderer import trace\nfrom scenes import catalog"),
        ("analysis/evaluation.py", "from tsar.policy import run\nfrom renderer.trace import Renderer"),
        ("scripts/run.py", "import renderer.trace, analysis.experiment, scenes.catalog, tsar.policy"),
        ("scenes/world.py", "from scenes import meshing\nfrom . import animation"),
    ],
)
def test_what_is_allowed_passes(path: str, source: str) -> None:
    assert violations(path, source) == []
