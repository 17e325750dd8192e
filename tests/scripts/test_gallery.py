"""One picture an effect, and the sheet."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image

from renderer.film.files import read_exr
from scenes.effects import scenes as effects
from tests.scripts.commands import call_script

SIZE = ("--width-px", "32", "--height-px", "24", "--samples", "4")


def test_named_effects_are_rendered_and_put_on_a_sheet(tmp_path: Path, monkeypatch, capsys) -> None:
    out = tmp_path / "out"
    assert call_script("gallery.py", monkeypatch, "quad-light", "plain", *SIZE, "--out", str(out)) == 0
    found = json.loads((out / "summary.json").read_text())
    assert list(found["effects"]) == ["quad-light", "plain"] and found["provenance"]["seed"] == 0
    lamp = found["effects"]["quad-light"]
    assert "rectangles that give light" in lamp["features"] and lamp["nonfinite"] == 0
    assert found["effects"]["plain"]["packets"] is True
    picture = read_exr(out / "quad-light.exr")
    assert picture.shape == (24, 32, 3)
    np.testing.assert_allclose(picture.mean(axis=(0, 1)), lamp["mean_radiance"], rtol=1e-3)
    with Image.open(out / "gallery.jpg") as sheet:
        assert sheet.width > 800
    assert "quad-light" in capsys.readouterr().out


def test_every_effect_can_be_loaded_and_has_words() -> None:
    assert len(effects.EFFECTS) >= 16
    for name, effect in effects.EFFECTS.items():
        assert effects.load(name).instances and effect.what
