"""What the base holds, what the extras add, and what a command says where one is missing."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from analysis.command.extras import DISTRIBUTION, EXTRAS
from tests.scripts.commands import ROOT, assert_refused, call_script, one_line

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
OPTIONAL = {
    extra: [Requirement(line) for line in lines] for extra, lines in PROJECT["project"]["optional-dependencies"].items()
}
BASE = [Requirement(line) for line in PROJECT["project"]["dependencies"]]
PACKAGES = ("tsar", "renderer", "analysis", "scenes")

LACKING = [
    ("suitability.py", (), "distributed", "study"),
    ("ablation.py", (), "distributed", "study"),
    ("precision.py", (), "distributed", "study"),
    ("workloads.py", (), "distributed", "study"),
    ("trade.py", (), "optuna", "search"),
    ("trade.py", ("--trials", "0"), "distributed", "study"),
    ("sensitivity.py", (), "distributed", "study"),
    ("render.py", ("glass", "--denoise"), "pyoidn", "denoise"),
    ("tiles.py", ("glass",), "dask", "study"),
    ("perception.py", ("adaptive", "fly-by"), "distributed", "study"),
    ("conversion_check.py", ("--markers",), "pyluxcore", "peers"),
]


def constraints() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text().split()
    return {canonicalize_name(name): version for name, _, version in (line.partition("==") for line in lines)}


@pytest.mark.parametrize(("script", "arguments", "module", "extra"), LACKING)
def test_a_command_names_the_extra_that_it_lacks(
    script: str, arguments: tuple[str, ...], module: str, extra: str, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.chdir(tmp_path)
    status = call_script(script, monkeypatch, *arguments)
    assert_refused(status, capsys, (EXTRAS[extra][module], f"the extra '{extra}' of {DISTRIBUTION}"))
    assert not list(tmp_path.iterdir())


def test_an_import_that_fails_within_a_command_names_the_extra(tmp_path: Path) -> None:
    script = str(ROOT / "scripts" / "convert.py")
    blocked = f"import runpy, sys; sys.modules['defusedxml'] = None; runpy.run_path({script!r}, run_name='__main__')"
    arguments = [str(ROOT / "scenes/assets/cornell-box/cornell-box.xml"), "out.pbrt"]
    command = [sys.executable, "-c", blocked, *arguments]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and one_line(done.stderr) and not list(tmp_path.iterdir()), done.stderr
    assert "package defusedxml" in done.stderr and "the extra 'formats'" in done.stderr


@pytest.mark.slow
def test_the_base_alone_compares_and_explains_every_command(tmp_path: Path) -> None:
    names = [module for modules in EXTRAS.values() for module in modules]
    blocked = f"import runpy, sys; sys.modules.update(dict.fromkeys({names})); "
    blocked += "runpy.run_path(sys.argv.pop(1), None, '__main__')"

    def run(script: Path, *arguments: str) -> None:
        command = [sys.executable, "-c", blocked, str(script), *arguments]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr

    small = ["--seconds", "0.2", "--resolution-px", "128", "--batch-size", "32", "--out", "out"]
    run(ROOT / "scripts/run.py", "fly-by", *small)
    assert (tmp_path / "out" / "report.html").is_file()
    for script in (ROOT / "scripts").glob("*.py"):
        run(script, "--help")


def test_a_module_of_our_own_that_is_missing_is_a_fault_of_ours(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "analysis.command.console", None)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ModuleNotFoundError, match=r"analysis\.command\.console"):
        call_script("pointsets.py", monkeypatch)


def test_a_package_that_an_environment_of_an_earlier_version_lacks_is_named(
    monkeypatch, tmp_path: Path, capsys
) -> None:
    """Such as one that the base needs since then, also where it is imported late."""
    (tmp_path / "concave.obj").write_text("v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.5 0\nv 0 2 0\nf 1 2 3 4 5\n")
    monkeypatch.setitem(sys.modules, "mapbox_earcut", None)
    status = call_script("render.py", monkeypatch, str(tmp_path / "concave.obj"), "--out", str(tmp_path / "out"))
    said = capsys.readouterr().err
    assert status == 2 and one_line(said) and "expected the package mapbox_earcut, found none" in said


def test_extras_are_those_of_the_project_file() -> None:
    found = {extra: {found.name for found in OPTIONAL[extra]} for extra in EXTRAS}
    assert found == {extra: set(modules.values()) for extra, modules in EXTRAS.items()}
    assert PROJECT["project"]["name"] == DISTRIBUTION
    assert not {one.name for one in BASE} & {name for modules in EXTRAS.values() for name in modules.values()}


def test_constraints_have_one_version_in_the_range_of_every_requirement() -> None:
    pinned = constraints()
    every = [one for one in [*BASE, *(one for found in OPTIONAL.values() for one in found)] if one.name != DISTRIBUTION]
    for one in every:
        version = pinned[canonicalize_name(one.name)]
        assert one.specifier.contains(version, prereleases=True), f"{one}: constraints.txt has {version}"
    assert pinned["torch"] == "2.13.0" and pinned["torchvision"] == "0.28.0"


def test_constraints_are_recorded_with_all_extras_installed(tmp_path: Path) -> None:
    """In an environment that lacks some of them, their lines would be lost; a recording that fails changes nothing."""
    asked = ["make", "--dry-run", "constraints", f"VENV={tmp_path}", "PYTHON=python3"]
    done = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=True)
    lines = [line for line in done.stdout.splitlines() if "constraints.txt" in line or "pip list" in line]
    installed = set(re.search(r"\.\[([\w,]+)\]", lines[-3])[1].split(","))
    for extra in tuple(installed):
        installed |= {one for found in OPTIONAL[extra] if found.name == DISTRIBUTION for one in found.extras}
    assert installed == set(OPTIONAL)
    assert "pip list" in lines[-2] and re.fullmatch(r"mv \S+ constraints\.txt", lines[-1])


def test_an_installed_copy_has_every_file_of_the_packages(tmp_path: Path) -> None:
    steps = ["egg_info", "--egg-base", str(tmp_path), "build", "--build-base", str(tmp_path)]
    build = [sys.executable, "-c", "from setuptools import setup; setup()", "--quiet", *steps]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True, timeout=120)
    files = {path.relative_to(ROOT) for name in PACKAGES for path in (ROOT / name).rglob("*") if path.is_file()}
    wanted = {path for path in files if "__pycache__" not in path.parts and path.suffix != ".pyc"}
    built = {path.relative_to(tmp_path / "lib") for path in (tmp_path / "lib").rglob("*") if path.is_file()}
    assert built == wanted
    assert {Path(name, "py.typed") for name in PACKAGES} <= built
