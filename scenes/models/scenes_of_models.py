"""Models as scenes, so that a model file can be used in place of a scene file."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from scenes.canonical import Instance, Scene
from scenes.formats.losses import LossReport
from scenes.formats.text.format import Format
from scenes.models import MODEL_ENDINGS, read_model
from scenes.models.smoothing import smoothed
from scenes.viewing import Up, framed

_Y_UP = (".obj", ".gltf", ".glb")
"""Endings of formats whose files have y upwards: glTF by its specification, OBJ by convention."""


def model_up(path: Path) -> Up:
    """The upward axis of a model, by the ending of its file name."""
    return "y" if path.suffix.lower() in _Y_UP else "z"


def model_scene(
    path: Path, report: LossReport, up: Up | None = None, smooth_deg: float = 0.0, facets: bool = False
) -> Scene:
    """A model with lights and a camera that shows all of it (:func:`scenes.viewing.framed`).

    Args:
        path: see :func:`scenes.models.read_model`.
        report: receives the losses.
        up: upward axis; by default :func:`model_up`.
        smooth_deg: see :func:`scenes.models.place_model`.
        facets: see :func:`scenes.models.read_model`.

    Raises:
        SceneError: the model cannot be read.
    """
    scene = framed(smoothed(read_model(path, report, facets), smooth_deg), up or model_up(path), path.stem)
    return dataclasses.replace(scene, duration_s=duration_of(scene.instances))


def duration_of(instances: tuple[Instance, ...]) -> float:
    """The time of the last key of all motions, seconds."""
    tracks = [instance.track for instance in instances if instance.track is not None]
    return max((track.start_s + track.interval_s * (len(track.translation) - 1) for track in tracks), default=0.0)


def _read(path: Path, root: Path | None, report: LossReport) -> Scene:
    return model_scene(path, report)


MODEL = Format("a model", MODEL_ENDINGS, _read)
