"""The first experience of a new user: bad input is reported before anything loads, and so is a size that changes the
pace."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.command import cli
from analysis.comparison.options import RunOptions
from analysis.tracer.render_options import RenderOptions
from scenes.canonical import SceneError
from scenes.catalog import require_known
from tsar.config import ConfigError, TsarConfig

ROOT = Path(__file__).resolve().parents[3]


def test_the_machine_follows_the_size_unless_its_capacity_is_given() -> None:
    small = RunOptions("fly-by", tsar=TsarConfig(resolution_px=128))
    assert small.machine_flops == RunOptions("fly-by").machine_flops / 16.0 == 8.7e10 / 16.0
    assert small.pace == (
        "resolution_px: 128: the machine has 5.44e+09 FLOP/s, for 8.03 framed images a second, as at 512² "
        "(--capacity sets it)"
    )
    given = dataclasses.replace(small, capacity=8.7e10)
    assert given.machine_flops == 8.7e10
    assert given.pace == RunOptions("fly-by").pace == dataclasses.replace(small, ledger="wall").pace == ""


def test_unknown_scenes_are_refused_by_name() -> None:
    with pytest.raises(ConfigError, match=r"^scene: expected one of corner-exit, .*got 'flyby' \(nearest: fly-by\)"):
        require_known("flyby")
    with pytest.raises(SceneError, match=r"^some/file\.pbrt: expected a scene file or a model, found none"):
        require_known("some/file.pbrt")
    for known in ("fly-by", "2", "glass", __file__):
        require_known(known)


@pytest.mark.parametrize(
    ("module", "arguments", "said"),
    [
        ("tracer.gallery_command", "glas", "effects: expected one of plain"),
        ("tracer.job_command", "gone.txt", "gone.txt: cannot be read"),
        ("spectrum.command", "gone.png", "gone.png: cannot be read"),
        ("perception.command", "stimuli gone.txt", "gone.txt: cannot be read"),
        ("perception.command", "analyse gone.csv", "gone.csv: cannot be read"),
        ("comparison.run_command", "flyby", "scene: expected one of corner-exit"),
        ("comparison.run_command", "gone.pbrt", "gone.pbrt: expected a scene file or a model"),
        ("comparison.run_command", "fly-by --environment gone.hdr", "gone.hdr: cannot be read"),
        ("tracer.render_command", "gone.obj", "gone.obj: expected a scene file or a model"),
        ("tracer.render_command", "fly-by --camera-keys gone.csv", "gone.csv: cannot be read"),
        ("tracer.tiles_command", "gone.obj", "gone.obj: expected a scene file or a model"),
        ("live.command", "gone.session", "gone.session: expected a scene file or a model"),
        ("trade.command", "--inputs fly-by gone.pbrt", "inputs: expected a scene by its name, or a file that is there"),
    ],
)
def test_bad_input_is_refused_before_libraries_load(module: str, arguments: str, said: str) -> None:
    program = (
        f"import sys; sys.argv = ['x', *{arguments.split()}]\nfrom analysis.{module} import main\n"
        "try: main()\nexcept ValueError as error: print(error, *{'torch', 'warp'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.startswith(said) and not {"torch", "warp"} & set(done.stdout.split()), done.stdout


@pytest.mark.parametrize(
    ("given", "blamed"),
    [
        ({"capacity": 1e6}, "capacity: .* got 1000000.0"),
        ({"seconds": 0.001}, "seconds: .* got 0.001"),
        (
            {"seconds": 0.2, "policy": "thesis", "reference_rate_hz": 5.0},
            "seconds: expected time for a cycle",
        ),
    ],
)
def test_cycles_too_long_for_a_run_blame_an_option_that_was_given(given: dict, blamed: str) -> None:
    with pytest.raises(ConfigError, match=f"^{blamed}"):
        RunOptions("fly-by", **{"rivals": ("framed",), **given})


@pytest.mark.parametrize("samples", [10, 26, 28])
def test_stratified_samples_are_a_cube(samples: int) -> None:
    with pytest.raises(ConfigError, match=rf"^samples: expected a cube for the point set stratified, .*got {samples}"):
        RenderOptions("glass", samples=samples, point_set="stratified")
    RenderOptions("glass", samples=27, point_set="stratified")


def test_a_python_without_the_packages_is_told_what_to_do(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    def main() -> None:
        raise ModuleNotFoundError("No module named 'tyro'", name="tyro")

    with pytest.raises(ModuleNotFoundError):
        cli.run_cli(main)
    monkeypatch.setattr(cli.importlib.util, "find_spec", lambda name: None if name == "tyro" else name)
    with pytest.raises(SystemExit, match="2"):
        cli.run_cli(main)
    shown = capsys.readouterr().err
    assert shown.count("\n") == 1 and "expected the package tyro" in shown and ". .venv/bin/activate" in shown


@pytest.mark.parametrize("script", ["run", "render", "live", "suitability"])
def test_a_script_run_by_a_python_without_packages_ends_with_one_line(script: str) -> None:
    command = [sys.executable, "-I", "-S", f"scripts/{script}.py", "fly-by"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert done.stderr.startswith("error: expected the package ") and ". .venv/bin/activate" in done.stderr


def test_a_command_that_ends_well_ends_at_once() -> None:
    """Its exit functions and threads have run, and what it printed is there."""
    program = (
        "import atexit, threading, time\nfrom analysis.command.cli import run_process\n"
        "class Last:\n    def __del__(self): print('never')\n"
        "def main():\n    global kept\n    kept = Last()\n    atexit.register(print, 'exit')\n"
        "    threading.Thread(target=lambda: (time.sleep(0.1), print('thread'))).start()\n    print('main')\n"
        "run_process(main)"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "main\nthread\nexit\n", "")


def test_flip_and_jod_are_taken_unless_something_else_is_asked() -> None:
    assert RunOptions("fly-by").further_metrics == ("flip", "jod")
    assert RunOptions("fly-by", metrics=()).further_metrics == ()
    assert RunOptions("fly-by", metrics=("ssim",)).further_metrics == ("ssim",)
    assert RunOptions("fly-by", reference_rate_hz=50.0).further_metrics == ("flip",), "60 Hz shows no 50 Hz"
    with pytest.raises(ConfigError, match="reference_rate_hz: expected a whole fraction of the display's 60 Hz"):
        RunOptions("fly-by", metrics=("jod",), reference_rate_hz=50.0)


@pytest.mark.parametrize(("seconds", "jod_s", "expected"), [(2.0, 0.25, 15), (0.1, 0.25, 6), (2.0, 5.0, 120)])
def test_metrics_of_sequences_score_the_middle_of_a_run(seconds: float, jod_s: float, expected: int) -> None:
    assert RunOptions("fly-by", seconds=seconds, jod_s=jod_s).images_scored == expected
