"""Conversion between scene files of different renderers, through the canonical scene."""

from __future__ import annotations

import difflib
import gc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from scenes.canonical import Scene, SceneError
from scenes.formats import FORMATS
from scenes.formats.losses import LossReport
from scenes.formats.text.output import Output
from scenes.loading import one_line


def format_of(path: Path) -> str:
    """The name of a file's format, from the ending of its name.

    Raises:
        SceneError: no format has the ending; the message lists the known endings and the nearest of them.
    """
    ending = Path(path).suffix.lower()
    known: dict[str, str] = {}
    for name in FORMATS:
        for other in FORMATS[name].endings:
            known.setdefault(other, name)
    if ending not in known:
        near = difflib.get_close_matches(ending, known, n=1)
        hint = f" (nearest: {near[0]})" if near else ""
        raise SceneError(f"{path}: expected a name that ends in {', '.join(known)}, got {ending!r}{hint}")
    return known[ending]


@contextmanager
def _without_collections() -> Iterator[None]:
    """Holds off the search for cycles among the objects of a scene, which live on and would be searched again and
    again."""
    on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if on:
            gc.enable()


def load_scene_file(path: Path, root: Path | None = None, report: LossReport | None = None) -> Scene:
    """Reads a scene file of any format.

    Args:
        path: the file.
        root: folder outside of which nothing is read; by default the file's own.
        report: receives the losses.

    Raises:
        SceneError: the file cannot be read; the message gives file, line and column.
    """
    found = FORMATS[format_of(path)]
    if found.read is None:
        raise SceneError(f"{path}: expected a format that can be read, {found.name} can be written only")
    try:
        with _without_collections():
            return found.read(Path(path), root, report or LossReport())
    except (ArithmeticError, np.linalg.LinAlgError, RecursionError, MemoryError) as error:
        raise SceneError(f"{path}: expected a scene of usual size and numbers ({one_line(error)[:100]})") from error


def save_scene_file(
    scene: Scene, path: Path, to: str | None = None, report: LossReport | None = None, strict: bool = False
) -> None:
    """Writes a scene with its meshes and images, completely or not at all.

    Args:
        scene: scene to write.
        path: file to write; meshes and images are written to folders beside it.
        to: name of the format; by default that of the file's ending.
        report: receives the losses.
        strict: whether any loss in the report, including those from reading, is an error.

    Raises:
        ConfigError: ``to`` names no format.
        SceneError: the scene cannot be written, or there is a loss and ``strict`` is true.
    """
    found, wanted = report or LossReport(), FORMATS[to or format_of(path)]
    if wanted.write is None:
        raise SceneError(f"{path}: expected a format that can be written, {wanted.name} can be read only")
    output = Output(path)
    try:
        with _without_collections():
            wanted.write(scene, output, found)
        if strict:
            found.refuse_any()
        output.place()
    finally:
        output.discard()
