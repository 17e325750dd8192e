"""LuxRender files, read into the canonical scene."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from scenes.formats.conversion import load_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import HEAD


def test_light_given_by_power_is_spread_over_its_area(tmp_path: Path) -> None:
    """100 W at 17 lm/W over a square of four units: radiance 1700 / (4 π) of luminance 1."""
    body = 'AreaLightSource "area" "color L" [1 1 1]\nShape "trianglemesh" "integer indices" [0 1 2 0 2 3] '
    body += '"point P" [-1 -1 0 1 -1 0 1 1 0 -1 1 0]\n'
    (tmp_path / "a.lxs").write_text(HEAD + body)
    (lamp,) = load_scene_file(tmp_path / "a.lxs").instances
    assert lamp.emission == pytest.approx((1700.0 / (4.0 * math.pi),) * 3, rel=1e-4)


def test_spectra_of_lamps_are_textures_in_luxrender(tmp_path: Path) -> None:
    lamps = ('"blackbody" "float temperature" [3000]', '"equalenergy" "float energy" [0.7]')
    lines = [f'Texture "t{n}" "color" {kind}' for n, kind in enumerate(lamps)]
    lines += [f'LightSource "point" "texture L" ["t{n}"] "float power" [0]' for n in range(2)]
    (tmp_path / "a.lxs").write_text(HEAD + "\n".join(lines))
    report = LossReport()
    warm, even = load_scene_file(tmp_path / "a.lxs", None, report).lights
    assert warm.intensity[0] > 2.0 * warm.intensity[2] > 0.0  # type: ignore[union-attr]
    assert even.intensity == pytest.approx((0.7 / (4.0 * math.pi),) * 3)  # type: ignore[union-attr]
    assert not report.losses
