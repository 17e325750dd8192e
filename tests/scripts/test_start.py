"""Command lines answer before anything large is imported."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.scripts.commands import ROOT

SCRIPTS = sorted(path.name for path in (ROOT / "scripts").glob("*.py") if path.name != "__init__.py")
HEAVY = (
    *("torch", "warp", "kornia", "scipy", "matplotlib", "pandas", "pyarrow", "av", "trimesh", "OpenEXR", "mitsuba"),
    *("embreex", "pywt", "dask", "distributed"),
)
PROGRAM = """
import atexit, json, runpy, sys
atexit.register(lambda: print("\\n" + json.dumps(sorted({name.partition(".")[0] for name in sys.modules}))))
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def start(folder: Path, *arguments: str) -> tuple[int, set[str], str]:
    """Exit status of a script, top-level packages it has imported, and what it printed."""
    command = [sys.executable, "-c", PROGRAM, *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    shown, _, last = done.stdout.rstrip().rpartition("\n")
    return done.returncode, set(json.loads(last)), shown + done.stderr


@pytest.mark.parametrize("name", SCRIPTS)
def test_help_imports_nothing_large(name: str, tmp_path: Path) -> None:
    status, modules, shown = start(tmp_path, str(ROOT / "scripts" / name), "--help")
    assert status == 0 and "usage" in shown.lower() and "tyro" in modules
    assert not modules & set(HEAVY)


@pytest.mark.parametrize(
    ("name", "arguments", "said"),
    [
        ("run.py", ("fly-by", "--batch-size", "-1"), "batch_size"),
        ("report.py", ("gone",), "gone: expected the folder of a finished run"),
        ("trade.py", ("--knobs", "bach"), "knobs: expected one of policy, batch"),
        ("bench.py", ("--only", "cohrent"), "(nearest: coherent)"),
        ("spectrum.py", ("--only", "slops"), "one of agreement, ideal, slopes, got 'slops'"),
        ("gallery.py", ("--samples", "10", "--point-set", "stratified"), "such as 8 or 27, got 10"),
        ("tiles.py", ("report-one", "--samples", "10", "--point-set", "stratified"), "such as 8 or 27, got 10"),
        ("render.py", ("plain", "--samples", "5000", "--point-set", "poisson"), "1 to 4096 for the point set poisson"),
        ("render.py", ("plain", "--size", "0x7"), "size: expected sides between 1 and 32768, got '0x7'"),
        ("perception.py", ("simulate", "gone"), "gone/manifest.json"),
        ("perception.py", ("serve", "ANNA", "--stimuli", "gone"), "gone/manifest.json"),
        ("suitability.py", ("--scheduler", "far"), "scheduler: expected an address such as tcp://host:8786, got 'far'"),
        ("convert.py", ("gone.pbrt",), "TARGET"),
        ("report.py", (), "folders: expected at least one, got none"),
        ("trade.py", ("--search-knobs", "bach"), "search_knobs: expected one of policy, batch"),
    ],
)
def test_bad_options_are_refused_as_early(name: str, arguments: tuple[str, ...], said: str, tmp_path: Path) -> None:
    status, modules, shown = start(tmp_path, str(ROOT / "scripts" / name), *arguments)
    assert status == 2 and said in shown, shown
    assert not modules & set(HEAVY)


@pytest.mark.parametrize(
    ("name", "option", "field"),
    [
        ("spectrum.py", "--input", "input"),
        ("cost_report.py", "--input", "input"),
        ("bench.py", "--scenes", "scenes"),
        ("ablation.py", "--inputs", "inputs"),
    ],
)
def test_a_scene_that_is_not_known_is_told_early_under_the_option_that_was_typed(
    name: str, option: str, field: str, tmp_path: Path
) -> None:
    status, modules, shown = start(tmp_path, str(ROOT / "scripts" / name), option, "fly-bye")
    assert status == 2 and shown.startswith(f"error: {field}: expected one of") and "(nearest: fly-by)" in shown
    assert not modules & {"torch", "warp", "matplotlib", "distributed"}


def test_a_large_import_is_seen(tmp_path: Path) -> None:
    """The check above can fail."""
    (tmp_path / "slow.py").write_text("import sys, scipy, PIL, pandas\nsys.exit(3)\n")
    status, modules, _ = start(ROOT, str(tmp_path / "slow.py"))
    assert status == 3 and modules & set(HEAVY) >= {"scipy", "pandas"}
