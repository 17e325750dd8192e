"""The command that renders tiles."""

from __future__ import annotations

import json
from pathlib import Path

from renderer.film.files import read_exr
from tests.scripts.commands import call_script, one_line


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


def test_a_crop_is_that_part_of_the_picture(tmp_path: Path, monkeypatch, capsys) -> None:
    """Four of six tiles are traced. A crop outside of the picture is refused."""
    arguments = ("plain", "--size", "40x30", "--samples", "4", "--workers", "1")
    for name, more in (("whole", ()), ("part", ("--crop", "3", "5", "20", "15"))):
        assert call_script("tiles.py", monkeypatch, *arguments, *more, "--out", str(tmp_path / name)) == 0
    whole, part = (read_exr(tmp_path / name / "plain.exr") for name in ("whole", "part"))
    assert whole.shape == (30, 40, 3) and (part == whole[5:20, 3:23]).all()
    found = json.loads((tmp_path / "part" / "summary.json").read_text())
    assert found["rays"]["primary_rays"] == 4 * 256 * 4
    capsys.readouterr()
    outside = ("--crop", "30", "0", "20", "15", "--out", str(tmp_path / "no"))
    assert call_script("tiles.py", monkeypatch, *arguments, *outside) == 2
    assert one_line(capsys.readouterr().err) and not (tmp_path / "no").exists()
