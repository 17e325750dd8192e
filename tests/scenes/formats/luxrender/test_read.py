"""LuxRender files, read into the canonical scene."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from analysis.conversion.peers import rendered
from scenes.canonical import ConstantTexture, Matte
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


def test_the_gain_of_a_lamp_multiplies_its_power(tmp_path: Path) -> None:
    """LuxCore 2.10 draws this square with a radiance of 135.28, and of 270.56 at a gain of 2."""
    square = '\nShape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [-1 -1 0 1 -1 0 1 1 0 -1 1 0]\n'
    for gain, radiance in ((1.0, 135.28), (2.0, 270.56)):
        lamp = f'AreaLightSource "area" "color L" [1 1 1] "float gain" [{gain}] "float power" [100]{square}'
        (tmp_path / "a.lxs").write_text(HEAD + lamp)
        (found,) = load_scene_file(tmp_path / "a.lxs").instances
        assert found.emission == pytest.approx((radiance,) * 3, rel=1e-4)


def test_materials_and_objects_in_files_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "a.lxm").write_text('MakeNamedMaterial "red" "string type" ["matte"] "color Kd" [.8 .1 .1]\n')
    (tmp_path / "a.lxo").write_text('AttributeBegin\nNamedMaterial "red"\nShape "sphere"\nAttributeEnd\n')
    (tmp_path / "a.lxs").write_text(HEAD + 'Include "a.lxm"\nInclude "a.lxo"\nWorldEnd\n')
    report = LossReport()
    (found,) = load_scene_file(tmp_path / "a.lxs", None, report).instances
    assert found.material == Matte(ConstantTexture((0.8, 0.1, 0.1))) and not report.losses


@pytest.mark.parametrize(("width", "height"), [(64, 32), (32, 64)])
def test_an_angle_without_a_window_is_that_of_the_shorter_side(width: int, height: int, tmp_path: Path) -> None:
    """A square of half the width that the angle covers: LuxCore has the angle along the longer side."""
    film = f'Film "fleximage" "integer xresolution" [{width}] "integer yresolution" [{height}]\n'
    shape = '"integer indices" [0 1 2 0 2 3] "point P" [-1 -1 -2 1 -1 -2 1 1 -2 -1 1 -2]\n'
    lamp = f'AreaLightSource "area" "float power" [0] "float efficacy" [0]\nShape "trianglemesh" {shape}'
    wide, high = width / min(width, height), height / min(width, height)
    for window, side_px in (("", 32), (f'"float screenwindow" [{-wide} {wide} {-high} {high}]', 16)):
        camera = f'LookAt 0 0 0 0 0 -1 0 1 0\nCamera "perspective" "float fov" [90] {window}\n'
        file, report = tmp_path / f"{side_px}.lxs", LossReport()
        file.write_text(f"{film}{camera}WorldBegin\n{lamp}WorldEnd\n")
        pytest.importorskip("pyluxcore")
        picture = rendered("luxcore", file, tmp_path / "a.npy", (width, height), 16, 300.0)
        assert not isinstance(picture, str) and np.ptp(np.nonzero(picture[height // 2, :, 0] > 0.5)) + 1 == side_px
        scene = load_scene_file(file, None, report)
        assert scene.camera.fov_deg == pytest.approx(90.0)  # type: ignore[union-attr]
        assert [loss.what for loss in report.losses if loss.picture] == (
            [] if window else ["an angle of view without screenwindow, which LuxCore has along the longer side"]
        )
