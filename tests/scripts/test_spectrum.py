"""The spectrum script from end to end, small, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

from renderer.film.files import write_exr
from tests.scripts.commands import assert_refused, call_script, nothing_in, run_script

SLOPES = ("--frames-per-input", "1", "--samples-per-axis", "2")
TSAR = ("--resolution-px", "64", "--sdf-side", "16", "--batch-size", "16", "--tile-count-max", "16")
IDEAL = ("--ideal-samples", "32", "--ideal-frames", "16")
AGREEMENT = ("--tiles-per-input", "4", "--agreement-samples", "64", "--agreement-frames", "16")
SMALL = ("--inputs", "fly-by", *SLOPES, *TSAR, *IDEAL, *AGREEMENT)


def summary(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "summary.json").read_text())


def picture_is_drawn(path: Path) -> bool:
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB"))
    return min(pixels.shape[:2]) > 200 and pixels.std() > 5.0


def test_all_parts(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, tmp_path: Path) -> None:
    out, given = tmp_path / "out", tmp_path / "given.png"
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
    Image.fromarray(noise).save(given)
    assert call_script("spectrum.py", monkeypatch, str(given), *SMALL, "--out", str(out)) == 0
    shown = capsys.readouterr().out
    assert all(part in shown for part in ("Power-spectrum slopes", "Ideal density of tile 508", "Estimate against"))
    figures = ("slopes", "spectra", "ideal_tile", "ideal_norm", "ideal_surface", "ideal_estimate", "agreement")
    made = {*(f"{name}.png" for name in figures), "summary.json"}
    made |= {f"{name}.svg" for name in figures}
    assert {path.name for path in out.iterdir()} == {*made, "files.journal"}
    assert all(picture_is_drawn(out / f"{name}.png") for name in figures)
    found = summary(out)
    groups = found["slopes"]["groups"]
    assert groups["pictures given"]["slope"]["mean"] == pytest.approx(0.0, abs=0.5)
    assert groups["photographs"]["count"] == 2 and groups["photographs"]["slope"]["greatest"] < -2.0
    assert groups["frames, 1² samples a pixel"]["count"] == groups["frames, 2² samples a pixel"]["count"] == 1
    assert [name for name in groups if name.startswith("framelets")] == [f"framelets, level {n}" for n in (2, 3)]
    assert {row["name"] for row in found["slopes"]["spectra"]} >= {"given.png", "landscape_band.jpg", "fly-by 3.00 s"}
    assert found["ideal"]["tile"] == {"level": 5, "index": 508} and found["ideal"]["variance"] > 0.0
    assert 1 <= found["ideal"]["f_s"] <= 16 and 1 <= found["ideal"]["f_t"] <= 8
    check = found["agreement"]
    assert check["all"]["tiles"] == 4 and check["all"]["pairs"] == 36 and len(check["rates"]) == 9
    assert sum(map(sum, check["all"]["space"]["signs"])) == 36
    assert found["config"]["resolved"]["cycle_s"] > 0.0 and found["provenance"]["versions"]["torch"]


def test_one_part_in_a_process_of_its_own(tmp_path: Path) -> None:
    done = run_script("spectrum.py", tmp_path, "--only", "ideal", *TSAR, *IDEAL, "--tile-index", "7", "--out", "out")
    assert done.returncode == 0, done.stderr
    assert "Ideal density of tile 7" in done.stdout
    found = summary(tmp_path / "out")
    assert "ideal" in found and "slopes" not in found and "agreement" not in found
    assert found["ideal"]["tile"]["index"] == found["config"]["tile_index"] == 7


@pytest.mark.parametrize("content", ["missing", "text", "small", "constant", "infinite"])
def test_pictures_that_are_refused(
    content: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, tmp_path: Path
) -> None:
    path = tmp_path / ("bad.exr" if content == "infinite" else "bad.png")
    if content == "text":
        path.write_text("this is not a picture")
    elif content == "infinite":
        write_exr(path, torch.full((64, 64, 3), torch.nan))
    elif content != "missing":
        Image.new("RGB", (16, 16) if content == "small" else (64, 64), "red").save(path)
    status = call_script("spectrum.py", monkeypatch, str(path), "--only", "slopes", "--out", str(tmp_path / "out"))
    assert_refused(status, capsys, (str(path),))
    assert nothing_in(tmp_path / "out")
