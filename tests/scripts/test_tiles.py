"""The command that renders tiles."""

from __future__ import annotations

import json
from pathlib import Path

from renderer.film.files import read_exr
from tests.scripts.commands import call_script


def test_a_model_is_rendered_in_tiles(tmp_path: Path, monkeypatch, capsys) -> None:
    out = tmp_path / "out"
    model = Path(__file__).parents[1] / "scenes" / "models" / "cases" / "cube-without-normals.gltf"
    arguments = (str(model), "--width-px", "20", "--height-px", "20", "--samples", "4", "--workers", "1")
    assert call_script("tiles.py", monkeypatch, *arguments, "--out", str(out)) == 0, capsys.readouterr().err
    assert read_exr(out / f"{model.stem}.exr").shape == (20, 20, 3)


def test_a_picture_and_its_summary(tmp_path: Path, monkeypatch, capsys) -> None:
    out = tmp_path / "out"
    arguments = ("plain", "--width-px", "40", "--height-px", "30", "--samples", "4", "--workers", "1")
    assert call_script("tiles.py", monkeypatch, *arguments, "--out", str(out)) == 0
    assert read_exr(out / "plain.exr").shape == (30, 40, 3) and (out / "plain.png").exists()
    found = json.loads((out / "summary.json").read_text())
    assert found["chunks"] == found["chunks_rendered_now"] == 1 and found["nonfinite"] == 0
    assert found["rays"]["primary_rays"] == 6 * 256 * 4
    assert "1 chunks (1 now)" in capsys.readouterr().out
