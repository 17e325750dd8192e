"""Lights all around in Mitsuba 3, which has one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import EnvironmentLight, Light, PerspectiveCamera, Scene, SunSky
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport

SUN = SunSky((0.0, 0.6, 0.8), scale=2.0, part="sun")
SKY = SunSky((0.0, 0.6, 0.8), scale=3.0, part="sky")
EVEN = EnvironmentLight(np.ones((1, 1, 3), np.float32))


@pytest.mark.parametrize(
    ("lights", "emitters", "lost"),
    [
        ((SUN, SKY), 1, []),
        ((SKY, EVEN), 1, ["a further light all around"]),
        ((SUN, SunSky((0.0, 0.6, 0.8), 5.0, part="sky")), 1, ["a further light all around"]),
        ((EVEN,), 1, []),
    ],
)
def test_a_file_of_mitsuba_3_has_one_light_all_around(
    lights: tuple[Light, ...], emitters: int, lost: list[str], tmp_path: Path
) -> None:
    report = LossReport()
    save_scene_file(Scene(PerspectiveCamera(), (), lights), tmp_path / "a.xml", "mitsuba3", report)
    assert (tmp_path / "a.xml").read_text().count("<emitter") == emitters
    assert [loss.what for loss in report.losses if "light" in loss.what] == lost


def test_sun_and_sky_of_different_brightness_come_back(tmp_path: Path) -> None:
    save_scene_file(Scene(PerspectiveCamera(), (), (SUN, SKY)), tmp_path / "a.xml", "mitsuba3")
    found = load_scene_file(tmp_path / "a.xml").lights
    assert {one.part: one.scale for one in found if isinstance(one, SunSky)} == {"sun": 2.0, "sky": 3.0}
