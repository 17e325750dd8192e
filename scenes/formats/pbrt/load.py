"""Reader of PBRT scenes of versions 3 and 4."""

from __future__ import annotations

from pathlib import Path

from scenes.canonical import Scene, SceneError
from scenes.formats.directives.scene_reader import scene_of
from scenes.formats.losses import LossReport
from scenes.formats.pbrt.read import PbrtReader
from scenes.formats.pbrt.v4_read import PbrtV4Reader
from scenes.formats.pbrt.version import is_v4
from scenes.formats.text.scene_files import SceneFiles


def load_pbrt(path: Path, root: Path | None, report: LossReport) -> Scene:
    """Reads a scene; see :data:`scenes.formats.text.format.Read`.

    Raises:
        SceneError: the scene cannot be read; the message gives file, line and column.
    """
    files = SceneFiles(path, root)
    main = files.folder / Path(path).name
    if not main.is_file():
        raise SceneError(f"{path}: expected a scene file, found none")
    kind = PbrtV4Reader if is_v4(files.text(main, str(path))) else PbrtReader
    return scene_of(kind(SceneFiles(path, root), report), path)
