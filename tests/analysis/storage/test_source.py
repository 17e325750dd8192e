"""The hash of the code that made a result covers all that decides it, wherever that lies."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import pytest

from analysis.comparison.experiment import run_experiment
from analysis.metrics import METRICS
from analysis.storage import source
from analysis.storage.source import code_hash, hash_of_modules, version_of
from analysis.study.evaluation import evaluate
from renderer.trace import Renderer
from tsar.choices import NORMS, RECONSTRUCTIONS, SOLVERS
from tsar.named import Named
from tsar.policies import POLICIES

ROOT = Path(__file__).resolve().parents[3]
STUDY, RUN = "analysis/study/evaluation.py", "analysis/comparison/experiment.py"


def modules_of(maker: type | Callable) -> tuple[set[Path], set[str]]:
    """Files of the modules that the hash of a maker covers, and names of the libraries that they import."""
    return source._reached(*source._found([maker]))


ENTRIES = {"renderer/trace.py": Renderer, STUDY: evaluate, RUN: run_experiment}

PACKAGES = ("tsar", "renderer", "scenes", "analysis", "scripts")
PACKAGE = {
    "house/__init__.py": "",
    "house/start.py": "from house.room import door\nimport json\ntry:\n    import numpy\nexcept ImportError:\n    pass",
    "house/room/__init__.py": "",
    "house/room/door.py": """
        from typing import TYPE_CHECKING
        if TYPE_CHECKING:
            from house import types_only
        def open():
            with open("x"):
                from .deeper.handle import turn
        class Key:
            from . import lock
    """,
    "house/room/lock.py": "from ..cellar import wine",
    "house/room/deeper/handle.py": "",
    "house/room/deeper/native/grip.h": "int grip;",
    "house/cellar/__init__.py": "def __getattr__(name): ...",
    "house/cellar/barrels/red.py": "",
    "house/types_only.py": "",
    "house/unused/other.py": "",
}


@pytest.fixture
def house(tmp_path: Path) -> Path:
    for name, text in PACKAGE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(textwrap.dedent(text))
    return tmp_path


def changes(file: Path, hashed: Callable[[], str], text: str = "# changed") -> bool:
    before = hashed()
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes((file.read_bytes() if file.exists() else b"") + f"\n{text}\n".encode())
    return hashed() != before


@pytest.mark.parametrize("name", [name for name in PACKAGE if name not in ("house/types_only.py",)])
def test_every_file_that_is_imported_decides_it(house: Path, name: str) -> None:
    used = "unused" not in name
    assert changes(house / name, lambda: hash_of_modules(house, [house / "house/start.py"])) == used


def test_what_only_type_checkers_import_does_not(house: Path) -> None:
    assert not changes(house / "house/types_only.py", lambda: hash_of_modules(house, [house / "house/start.py"]))


@pytest.mark.parametrize(
    "name", ["house/room/deeper/new.py", "house/room/deeper/native/more/new.h", "house/data/a.bin"]
)
def test_a_new_file_decides_it_where_it_is_data_or_is_imported(house: Path, name: str) -> None:
    def hashed() -> str:
        return hash_of_modules(house, [house / "house/start.py"])

    assert changes(house / name, hashed) == (not name.endswith(".py"))
    if name.endswith(".py"):
        assert changes(house / "house/start.py", hashed, "import house.room.deeper.new")
        assert changes(house / name, hashed)


def test_moving_a_module_into_a_room_leaves_nothing_out(house: Path) -> None:
    (house / "house/hall").mkdir()
    (house / "house/start.py").rename(house / "house/hall/start.py")
    for name in (
        "house/room/door.py",
        "house/room/lock.py",
        "house/cellar/barrels/red.py",
        "house/room/deeper/handle.py",
    ):
        assert changes(house / name, lambda: hash_of_modules(house, [house / "house/hall/start.py"]))


def test_versions_of_libraries_decide_it(monkeypatch: pytest.MonkeyPatch) -> None:
    real, before = source.version_of, code_hash(Renderer)
    for name in ("torch", "warp", "numpy"):
        with monkeypatch.context() as patch:
            patch.setattr(source, "version_of", lambda other, name=name: "9" if other == name else real(other))
            assert code_hash(Renderer) != before
    assert {"kornia", "pycvvdp", "flip_evaluator", "torch", "warp"} <= modules_of(evaluate)[1]


@pytest.mark.parametrize("entry", ENTRIES)
def test_every_library_has_a_version(entry: str) -> None:
    """A name that cannot be resolved would leave its version out."""
    assert [name for name in modules_of(ENTRIES[entry])[1] if version_of(name) is None] == []


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("copy")
    for package in ("tsar", "renderer", "scenes", "analysis"):
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def only(copy: Path, stem: str) -> Path:
    (found,) = copy.rglob(stem)
    return found


@pytest.mark.parametrize(
    ("entry", "names"),
    [
        ("renderer/trace.py", ("kernels/shading.py", "kernels/lights.py", "shading.h", "tree.h", "canonical/scene.py")),
        ("renderer/trace.py", ("renderer/trace.py", "kernels/entry.py", "compute/team.py")),
        (STUDY, ("storage/records.py", "display_model.py", "torchvision_operators.py", "cost_model.py")),
        (STUDY, ("sky.exr", "hosek_wilkie.npz", "spheresscene.txt", "stages/control.py", "policies/framed.py")),
        (STUDY, ("kernels/shading.py", "shading.h", "response.h", "driving/world.py", "blocks/read.py")),
        (STUDY, ("metrics/perceptual.py", "metrics/quality.py", "study/displays.py")),
        (RUN, ("comparison/viewers.py", "kernels/shading.py", "response.h", "sky.exr", "pbrt/read.py")),
        (RUN, ("comparison/summary.py", "luxrender/read_materials.py", "policies/afr.py")),
    ],
)
def test_what_decides_a_result_is_in_its_hash(copy: Path, entry: str, names: tuple[str, ...]) -> None:
    start = only(copy, Path(entry).name)
    for name in names:
        files = [file for file in copy.rglob(name) if file.parts[-2] != "perception"]
        assert files
        for file in files:
            assert changes(file, lambda: hash_of_modules(copy, [start])), file


def test_a_file_format_does_not_decide_a_reference(copy: Path) -> None:
    assert not changes(copy / "renderer/film/files.py", lambda: hash_of_modules(copy, [only(copy, "trace.py")]))


@pytest.mark.parametrize("entry", ENTRIES)
def test_nothing_is_loaded_that_was_not_found(entry: str) -> None:
    """Python itself says which modules an import loads."""
    maker = ENTRIES[entry]
    files = "[m.__file__ for m in sys.modules.values() if getattr(m, '__file__', None)]"
    own = tuple(f"{ROOT}/{package}/" for package in PACKAGES)
    program = f"import sys, {maker.__module__}\nprint(*{files})"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = {Path(name) for name in done.stdout.split() if name.startswith(own)}
    assert len(loaded) > 5 and loaded <= modules_of(maker)[0]


def test_no_module_is_imported_by_a_name_that_cannot_be_read() -> None:
    """The exceptions are entries of tables, which are followed, and names that a package re-exports."""
    known = {ROOT / "tsar/named.py", ROOT / "tsar/lazy.py"}
    for module in set.union(*(modules_of(maker)[0] for maker in ENTRIES.values())) - known:
        names = {
            node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")
            for node in ast.walk(ast.parse(module.read_text()))
        }
        assert not names & {"import_module", "__import__", "exec"}, module


@pytest.mark.parametrize("table", [POLICIES, METRICS, SOLVERS, NORMS, RECONSTRUCTIONS], ids=lambda table: table.kind)
def test_what_a_table_names_decides_a_result(table: Named) -> None:
    reached = modules_of(evaluate)[0]
    for name in table:
        table[name]
        place = Path(sys.modules[table.origin(name).module].__file__ or "")
        assert place in reached, name


def test_a_place_in_a_table_is_followed(house: Path) -> None:
    (house / "house/start.py").write_text('TABLE = {"red": "house.cellar.barrels.red:Wine"}')
    before = hash_of_modules(house, [house / "house/start.py"])
    (house / "house/cellar/barrels/red.py").write_text("class Wine: ...")
    assert hash_of_modules(house, [house / "house/start.py"]) != before
