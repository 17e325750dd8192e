"""From a scene file of one renderer to that of another, by way of the canonical scene."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from scenes.canonical import Scene, SceneError
from scenes.formats.losses import LossReport
from scenes.formats.luxrender.read import load_luxrender
from scenes.formats.luxrender.write import save_luxrender
from scenes.formats.mitsuba.read import load_mitsuba
from scenes.formats.mitsuba.write import save_mitsuba, save_mitsuba3
from scenes.formats.pbrt.read import load_pbrt
from scenes.formats.pbrt.write import save_pbrt
from scenes.formats.text.output import Output

FormatName = Literal["pbrt", "luxrender", "mitsuba", "mitsuba3"]

ENDINGS: dict[str, FormatName] = {".pbrt": "pbrt", ".lxs": "luxrender", ".xml": "mitsuba"}
"""Formats by how the names of their files end."""

_LOADERS: dict[FormatName, Callable[[Path, Path | None, LossReport], Scene]] = {
    "pbrt": load_pbrt,
    "luxrender": load_luxrender,
    "mitsuba": load_mitsuba,
}
_SAVERS: dict[FormatName, Callable[[Scene, Output, LossReport], None]] = {
    "pbrt": save_pbrt,
    "luxrender": save_luxrender,
    "mitsuba": save_mitsuba,
    "mitsuba3": save_mitsuba3,
}


def format_of(path: Path) -> FormatName:
    """The format of a file by its name; raises SceneError for another ending."""
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        raise SceneError(f"{path}: expected a name that ends in {', '.join(ENDINGS)}, got {ending!r}")
    return ENDINGS[ending]


def load_scene_file(path: Path, root: Path | None = None, report: LossReport | None = None) -> Scene:
    """Reads a scene of any format.

    Args:
        path: the file.
        root: folder that nothing is read outside of; by default the file's own.
        report: receives what could not be kept.

    Raises:
        SceneError: it cannot be read; file, line, column.
    """
    return _LOADERS[format_of(path)](Path(path), root, report or LossReport())


def save_scene_file(
    scene: Scene, path: Path, to: FormatName | None = None, report: LossReport | None = None, strict: bool = False
) -> None:
    """Writes a scene, its meshes and pictures; all of it, or nothing.

    Args:
        scene: what to write.
        path: the file; meshes and pictures go to folders beside it.
        to: its format, by default that of the file's name.
        report: receives what could not be kept.
        strict: whether a loss in the report, also one from reading, is an error.

    Raises:
        SceneError: it cannot be written, or was not to lose anything and would.
    """
    found = report or LossReport()
    output = Output(path)
    try:
        _SAVERS[to or format_of(path)](scene, output, found)
        if strict:
            found.refuse_any()
        output.place()
    finally:
        output.discard()
