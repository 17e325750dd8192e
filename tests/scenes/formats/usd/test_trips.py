"""USD files as scenes for conversion: what comes back, and the pictures that renderers make of it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import ConstantTexture, Film, Matte, MetallicRough
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import DELIVERED, MITSUBA, REAL, drawn, needs_data, real
from tests.scenes.formats.gltf.test_read import SIDE_PX, blocks, scene_of

pytest.importorskip("pxr")


@needs_data
@pytest.mark.parametrize("name", [*REAL, *MITSUBA])
def test_real_scenes_come_back_from_usd(name: str, tmp_path: Path) -> None:
    """The same scene after the first trip, in text, in binary and in a package."""
    scene = real(name)
    save_scene_file(scene, tmp_path / "a.usda")
    trips = [load_scene_file(tmp_path / "a.usda")]
    for file in ("b.usdc", "c.usdz"):
        save_scene_file(trips[-1], tmp_path / file)
        trips.append(load_scene_file(tmp_path / file))
    assert difference(trips[0], trips[1]) is None and difference(trips[1], trips[2]) is None
    assert len(trips[0].instances) == len(scene.instances)
    save_scene_file(scene, tmp_path / "again" / "a.usda")
    assert (tmp_path / "again" / "a.usda").read_bytes() == (tmp_path / "a.usda").read_bytes()
