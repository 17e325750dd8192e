"""The command ``tsar``: it runs what the scripts run, and lists what has a name."""

from __future__ import annotations

import importlib
import subprocess
import sys
import tomllib
from importlib.metadata import version

import pytest

from analysis.command.cli import run_cli
from analysis.command.extras import DISTRIBUTION
from analysis.entry import COMMANDS, TABLES, main
from tests.scripts.commands import ROOT, one_line
from tsar.choices import SOLVERS
from tsar.response.transport import trivial


def call(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["tsar", *arguments])
    monkeypatch.setattr("analysis.entry.run_process", run_cli)  # the other would end this process
    try:
        main()
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


def test_every_script_is_a_command() -> None:
    renamed = {"suitability": "study"}
    for script in (ROOT / "scripts").glob("[a-z]*.py"):
        module = COMMANDS[renamed.get(script.stem, script.stem)]
        assert f'main = command("{module}")' in script.read_text() and callable(importlib.import_module(module).main)
    points = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    assert points == {"tsar": f"{main.__module__}:{main.__name__}"}


def test_a_command_gets_its_options_and_is_called_by_its_name(monkeypatch, capsys) -> None:
    assert call(monkeypatch, "render", "--help") == 0
    shown = capsys.readouterr().out
    assert "usage: tsar render" in shown and "tsar render fly-by" in shown and "scripts/" not in shown


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (("rnder",), ("command: expected one of run, ", "got 'rnder' (nearest: render)")),
        (("list", "policy"), ("list: expected one of policies, ", "nearest: policies")),
        (("run", "fly-by", "--policy", "thesys"), ("policy: expected one of tsar, ", "nearest: thesis")),
    ],
)
def test_bad_input_is_one_line(arguments, parts, monkeypatch, capsys) -> None:
    assert call(monkeypatch, *arguments) == 2
    shown = capsys.readouterr()
    assert shown.out == "" and one_line(shown.err) and all(part in shown.err for part in parts)


def test_lists_say_where_each_comes_from(monkeypatch, capsys) -> None:
    with SOLVERS.lent(mine=trivial):
        assert call(monkeypatch, "list") == 0
    shown = capsys.readouterr().out
    assert all(f"{name} (entry points: tsar." in shown for name in TABLES)
    for name in ("framed-super", "flip", "fly-by", "pbrt", "sobol", "waterfill", "linf", "blend"):
        assert f"  {name} " in shown
    (line,) = (line for line in shown.splitlines() if line.startswith("  mine "))
    assert f"tsar.response.transport ({DISTRIBUTION} " in line


def test_version_and_usage(monkeypatch, capsys) -> None:
    assert (
        call(monkeypatch, "--version") == 0 and capsys.readouterr().out == f"{DISTRIBUTION} {version(DISTRIBUTION)}\n"
    )
    assert call(monkeypatch) == 0 and "Commands: run, " in capsys.readouterr().out


def test_help_of_the_list_is_the_usage(monkeypatch, capsys) -> None:
    assert call(monkeypatch, "list", "--help") == 0
    assert "Tables: policies, metrics" in capsys.readouterr().out


def test_packages_offer_their_names_without_importing_them() -> None:
    program = "import sys, tsar, renderer, analysis; assert {'TsarConfig', 'run'} <= {*dir(tsar)}\n"
    program += "print(*(name for name in ('torch', 'warp', 'numpy', 'scenes') if name in sys.modules))\n"
    program += "print(tsar.TsarConfig(batch_size=64).batch_size, analysis.compare.__name__, renderer.render.__name__)"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["", "64 compare render"]


@pytest.mark.parametrize("package", ["tsar", "renderer", "analysis"])
def test_what_a_package_offers_is_there(package: str) -> None:
    offered = importlib.import_module(package)
    names = [name for name in dir(offered) if not name.startswith("_") and name not in ("TYPE_CHECKING", "lazily")]
    assert len(names) > 3 and all(getattr(offered, name) is not None for name in names)
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'nothing'"):
        offered.nothing  # noqa: B018
