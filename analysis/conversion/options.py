"""Options of scene conversion; imports little, so that ``--help`` is quick."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from scenes.formats import FORMATS
from tsar.config import require


@dataclass(frozen=True)
class ConvertOptions:
    """A scene file of one renderer as that of another, with its meshes and pictures, and a report of what was lost."""

    source: Annotated[Path, tyro.conf.Positional]
    """Scene file: PBRT v3 (.pbrt), LuxRender 1.x (.lxs) or Mitsuba 0.5 (.xml)."""
    target: Annotated[Path, tyro.conf.Positional]
    """File to write; meshes and pictures go to the folders models and textures beside it."""
    to: str = ""
    """Its format: pbrt, luxrender, mitsuba, mitsuba3 or another that is installed; by default that of its ending."""
    strict: bool = False
    """A loss is an error, and nothing is written."""
    report: Path | None = None
    """JSON file for the losses; by default the target's name with .losses.json."""
    root: Path | None = None
    """Folder that the scene may read from; by default its own."""

    def __post_init__(self) -> None:
        if self.to:
            FORMATS.require(self.to, "to")
        require(self.source.is_file(), "source", "a scene file", self.source)
        require(self.source.resolve() != self.target.resolve(), "target", "another file than the source", self.target)
        require(self.root is None or self.root.is_dir(), "root", "a folder", self.root)

    @property
    def report_file(self) -> Path:
        """Where the losses go."""
        return self.report or self.target.with_name(f"{self.target.name}.losses.json")
