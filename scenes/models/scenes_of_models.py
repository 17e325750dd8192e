"""Models as scenes, so that a model file can be used in place of a scene file."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from scenes.canonical import Instance, Scene, SceneError
from scenes.formats.losses import LossReport
from scenes.models import MODEL_ENDINGS, files_of, read_whole
from scenes.viewing import Up, framed

_Y_UP = (".obj", ".gltf", ".glb")
"""Endings of formats whose files have y upwards: glTF by its specification, OBJ by convention."""


def model_up(path: Path, facets: bool = False) -> Up:
    """The upward axis of a model: the one that its file names, or that of the ending of its name."""
    return read_whole(path, facets=facets).up or ("y" if path.suffix.lower() in _Y_UP else "z")


def is_posed(scene: object, facets: bool) -> bool:
    """Whether a scene is the file of a model whose parts are read at one time, since they do not move rigidly."""
    path = Path(scene) if isinstance(scene, (str, Path)) else Path()
    return path.suffix.lower() in MODEL_ENDINGS and path.is_file() and read_whole(path, facets=facets).posed


def content_of(scene: object, loaded: Scene, facets: bool) -> Any:
    """Everything in the input that decides the pictures of a scene at all times: the scene, and the files of a model
    that is posed.

    Args:
        scene, facets: as of :func:`is_posed`.
        loaded: the scene as at one time.
    """
    if not is_posed(scene, facets):
        return loaded
    return loaded, [np.fromfile(path, np.uint8) for path in files_of(Path(str(scene)), facets)]


def model_scene(
    path: Path,
    report: LossReport,
    up: Up | None = None,
    facets: bool = False,
    camera: str = "",
    time_s: float = 0.0,
) -> Scene:
    """A model with the lights and the first camera of its file; without such, with those of
    :func:`scenes.viewing.framed`, which show all of it as it is at its start.

    Args:
        path: see :func:`scenes.models.read_model`.
        report: receives the losses.
        up: upward axis; by default :func:`model_up`.
        facets: see :func:`scenes.models.read_model`.
        camera: name of a camera of the file; the first one if empty.
        time_s: see :func:`scenes.models.read_whole`.

    Raises:
        SceneError: the model cannot be read, or has no camera of this name.
    """
    model, first = read_whole(path, report, facets, time_s), read_whole(path, facets=facets)
    if camera and camera not in model.cameras:
        known = ", ".join(model.cameras) or "none"
        raise SceneError(f"camera: expected one of the cameras of {path} ({known}), got {camera!r}")
    shown = tuple(part for part in first.parts if part.emission is None) or first.parts
    found = None
    if model.cameras:
        found = model.cameras[camera] if camera else next(iter(model.cameras.values()))
    scene = framed(shown, up or model_up(path, facets), path.stem, None if found is None else found.camera)
    changed: dict[str, Any] = {} if found is None else {"film": found.film}
    if model.lit:
        changed |= {"lights": model.lights, "ambient": (0.0, 0.0, 0.0), "background": None}
    duration_s = duration_of(model.parts)
    return dataclasses.replace(scene, instances=model.parts, duration_s=duration_s, **changed)


def duration_of(instances: tuple[Instance, ...]) -> float:
    """The time of the last key of all motions, seconds."""
    tracks = [instance.track for instance in instances if instance.track is not None]
    return max((track.start_s + track.interval_s * (len(track.translation) - 1) for track in tracks), default=0.0)
