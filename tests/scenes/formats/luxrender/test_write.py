"""Files written for LuxRender."""

from __future__ import annotations

from pathlib import Path

from scenes.formats.conversion import save_scene_file
from tests.scenes.formats.files import pbrt


def test_textures_of_colours_have_a_type_that_luxrender_knows(tmp_path: Path) -> None:
    """It knows ``color``, ``float`` and ``fresnel``; ``spectrum`` is PBRT's."""
    body = 'Texture "c" "spectrum" "checkerboard"\nMaterial "matte" "texture Kd" "c"\nShape "sphere"\n'
    save_scene_file(pbrt(tmp_path, body)[0], tmp_path / "b.lxs")
    written = (tmp_path / "b.lxs").read_text()
    assert '"color" "checkerboard"' in written and "spectrum" not in written
