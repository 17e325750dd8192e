"""Scenes that tests of glTF write."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from scenes.canonical import ConstantTexture, Instance, Material, Matte, PerspectiveCamera, Rectangle, Scene
from scenes.formats.conversion import save_scene_file
from scenes.formats.losses import LossReport

GREY = Matte(ConstantTexture((0.5, 0.5, 0.5)))


def written(folder: Path, scene: Scene, name: str = "a.gltf") -> tuple[dict[str, Any], list[str]]:
    """The JSON of a scene, and the losses that change the picture."""
    report = LossReport()
    save_scene_file(scene, folder / name, None, report)
    return json.loads((folder / name).read_text()), [str(loss) for loss in report.losses if loss.picture]


def shown(*materials: Material, **more: Any) -> Scene:
    return Scene(PerspectiveCamera(), tuple(Instance(Rectangle(), material) for material in materials), **more)
