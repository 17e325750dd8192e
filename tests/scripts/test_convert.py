"""The command that converts scenes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenes.formats.conversion import load_scene_file
from tests.scripts.commands import assert_refused, call_script

SCENE = """LookAt 0 0 5 0 0 0 0 1 0
Scale -1 1 1
Camera "perspective" "float fov" 40
WorldBegin
Material "metal"
Shape "sphere"
Shape "cone"
WorldEnd
"""


@pytest.fixture
def source(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.pbrt").write_text(SCENE)
    return tmp_path / "in" / "a.pbrt"


def test_a_scene_is_converted_and_its_losses_are_reported(source: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    target = tmp_path / "out" / "b.lxs"
    assert call_script("convert.py", monkeypatch, str(source), str(target)) == 0, capsys.readouterr().err
    assert len(load_scene_file(target).instances) == 2
    report = json.loads((tmp_path / "out" / "b.lxs.losses.json").read_text())
    cone = {"where": "a.pbrt:7:1", "what": "shape 'cone'", "became": "a mesh of 64 triangles", "picture": True}
    assert cone in report["losses"] and [row["picture"] for row in report["losses"]].count(False) == 1
    assert report["provenance"]["commit"] and report["config"]["strict"] is False
    printed = capsys.readouterr().out
    assert "a.pbrt:7:1: shape 'cone': a mesh of 64 triangles" in printed and "2 shapes, 0 lights" in printed


def test_strict_writes_nothing_where_something_is_lost(source: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    target = tmp_path / "out" / "b.lxs"
    status = call_script("convert.py", monkeypatch, str(source), str(target), "--strict")
    assert_refused(status, capsys, ("expected a conversion without losses", "cone"))
    assert not any(path.is_file() for path in (tmp_path / "out").rglob("*"))


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (("gone.pbrt", "b.lxs"), ("source", "a scene file", "gone.pbrt")),
        (("a.pbrt", "a.pbrt"), ("target", "another file than the source")),
        (("a.pbrt", "b.txt"), ("b.txt", "expected a name that ends in .pbrt, .lxs, .xml")),
        (("a.pbrt", "b.lxs", "--root", "nowhere"), ("root", "a folder")),
        (("broken.pbrt", "b.lxs"), ("broken.pbrt:1:1", "expected a directive, got 'Nonsense'")),
    ],
)
def test_bad_input(arguments, parts, source: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(source.parent)
    (source.parent / "broken.pbrt").write_text("Nonsense 1\n")
    before = sorted(path.name for path in source.parent.iterdir())
    assert_refused(call_script("convert.py", monkeypatch, *arguments), capsys, parts)
    assert sorted(path.name for path in source.parent.iterdir()) == before
