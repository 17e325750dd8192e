"""The commands of docs/guides/tasks.md, as they are printed, and what they write."""

from __future__ import annotations

import re
import runpy
import shlex
from pathlib import Path

import av
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from tests.scripts.commands import call_script, one_line

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs/guides/tasks.md").read_text()
COMMANDS = {
    command.split()[-1].removeprefix("out/"): shlex.split(command)[1:]
    for command in re.findall(r"(?m)^```\n(python .*)\n```$", PAGE)
}
FIRST, *TASKS = COMMANDS


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files of the first command."""
    made = tmp_path_factory.mktemp("tasks")
    main = runpy.run_path(str(ROOT / COMMANDS[FIRST][0]))["main"]
    main(made / "out/models")
    return made


def call(name: str, monkeypatch: pytest.MonkeyPatch, folder: Path) -> int:
    script, *arguments = COMMANDS[name]
    monkeypatch.chdir(folder)
    return call_script(Path(script).name, monkeypatch, *arguments)


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image).astype(float)


def test_there_are_sixteen_tasks() -> None:
    code = re.findall(r"(?s)```python\n(.*?)```", PAGE)
    assert FIRST == "models" and len(TASKS) + len(code) + 1 == 16, "reading the layers is one of two in the notebook"
    assert len([line for line in code[0].splitlines() if line]) <= 10


SIZES = {"lens": (800, 600), "large": (200, 150), "cut-out": (100, 75), "usd": (100, 75), "quads": (200, 150),
         "far": (200, 150), "upright": (200, 150), "resumed": (100, 75), "crop": (100, 75),
         "adaptive": (100, 75)}  # fmt: skip


@pytest.mark.parametrize("name", SIZES)
def test_a_still_has_its_size_and_shows_something(name: str, folder: Path, monkeypatch, capsys) -> None:
    assert call(name, monkeypatch, folder) == 0, capsys.readouterr().err
    shown = pixels(folder / "out" / name / "frame00000.png")
    assert shown.shape == (*reversed(SIZES[name]), 3) and shown.std() > 8.0
    assert call(name, monkeypatch, folder) == 0 and "(0 rendered now" in capsys.readouterr().out, "it continues"


def test_a_model_far_away_looks_as_one_near(folder: Path, monkeypatch, capsys) -> None:
    for name in ("quads", "far"):
        assert call(name, monkeypatch, folder) == 0, capsys.readouterr().err
    near, far = (pixels(folder / "out" / name / "frame00000.png") for name in ("quads", "far"))
    assert np.abs(near - far).mean() < 0.5


def test_another_axis_is_upwards(folder: Path, monkeypatch, capsys) -> None:
    for name in ("large", "upright"):
        assert call(name, monkeypatch, folder) == 0, capsys.readouterr().err
    first, second = (pixels(folder / "out" / name / "frame00000.png") for name in ("large", "upright"))
    assert np.abs(first - second).mean() > 1.0


def test_a_film_follows_the_keys(folder: Path, monkeypatch, capsys) -> None:
    assert call("keys", monkeypatch, folder) == 0, capsys.readouterr().err
    with av.open(str(folder / "out/keys/film.mp4")) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(frames) == 5 and len({frame.tobytes() for frame in frames}) == 5


def test_layers_are_read_in_a_notebook(folder: Path, monkeypatch, capsys) -> None:
    assert call("layers", monkeypatch, folder) == 0, capsys.readouterr().err
    (code,) = re.findall(r"(?s)```python\n(.*?)```", PAGE)
    exec(compile(code, "notebook", "exec"), {})
    said = capsys.readouterr().out
    assert all(name in said for name in ("Z", "albedo.R", "normal.X", "instance", "motion.X", "samples", "variance.R"))
    assert pixels(folder / "out/notebook.png").std() > 8.0


def test_bad_input_is_one_line_and_status_two(folder: Path, monkeypatch, capsys) -> None:
    assert call("gone", monkeypatch, folder) == 2
    assert one_line(capsys.readouterr().err) and not (folder / "out/gone").exists()


def test_a_study_in_csv_is_analysed(folder: Path, monkeypatch, capsys) -> None:
    assert call("study", monkeypatch, folder) == 0, capsys.readouterr().err
    found = pd.read_csv(folder / "out/study/fits.csv").iloc[0]
    assert found["status"] == "within" and found["low"] <= found["jnd"] <= found["high"] and 4.0 < found["jnd"] < 100.0


def test_every_task_is_tested() -> None:
    assert {*SIZES, "keys", "layers", "gone", "study"} == set(TASKS)
