"""Files written for LuxRender."""

from __future__ import annotations

from pathlib import Path

from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import pbrt


def test_textures_of_colours_have_a_type_that_luxrender_knows(tmp_path: Path) -> None:
    """It knows ``color``, ``float`` and ``fresnel``; ``spectrum`` is PBRT's."""
    body = 'Texture "c" "spectrum" "checkerboard"\nMaterial "matte" "texture Kd" "c"\nShape "sphere"\n'
    save_scene_file(pbrt(tmp_path, body)[0], tmp_path / "b.lxs")
    written = (tmp_path / "b.lxs").read_text()
    assert '"color" "checkerboard"' in written and "spectrum" not in written


def test_lights_that_are_written_are_read_without_a_loss(tmp_path: Path) -> None:
    scene = pbrt(tmp_path, "".join(f'LightSource "{kind}"\n' for kind in ("point", "spot", "distant", "infinite")))[0]
    save_scene_file(scene, tmp_path / "b.lxs")
    report = LossReport()
    assert len(load_scene_file(tmp_path / "b.lxs", None, report).lights) == 4
    assert not [loss for loss in report.losses if loss.picture]
