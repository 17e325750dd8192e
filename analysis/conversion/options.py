"""Options of scene conversion; imports little, so that ``--help`` is quick."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from analysis.command import limits
from scenes.formats import FORMATS
from tsar.config import require
from tsar.named import require_known

FORMATS_OF = {"pbrt": ".pbrt", "pbrt4": ".pbrt", "mitsuba": ".xml", "mitsuba3": ".xml", "luxrender": ".lxs",
              "gltf": ".gltf", "usd": ".usda"}  # fmt: skip
"""Formats of the matrix and the endings of their files."""


@dataclass(frozen=True)
class ConvertOptions:
    """Converts a scene file of one renderer to that of another, with its meshes and pictures, and reports the
    losses."""

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    """Scene file: PBRT v3 or v4 (.pbrt), LuxRender 1.x (.lxs), Mitsuba 0.5 to 3 (.xml, .json), LuxCore (.cfg,
    .scn), or a model."""
    target: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="TARGET")]
    """File to write; meshes and pictures go to the folders models and textures beside it."""
    to: str = ""
    """Its format: pbrt, pbrt4, luxrender, luxrender-parts, mitsuba, mitsuba3, gltf, usd or an installed one; by
    default that of its ending."""
    strict: bool = False
    """A loss that changes the picture is an error, and nothing is written."""
    report: Path | None = None
    """JSON file for the losses; by default the target's name with .losses.json."""
    root: Path | None = None
    """Folder that scenes may read from; by default its own."""

    def __post_init__(self) -> None:
        if self.to:
            FORMATS.require(self.to, "to")
        require(self.source.is_file(), "source", "a scene file that is there", self.source)
        require(self.source.resolve() != self.target.resolve(), "target", "another file than the source", self.target)
        require(self.root is None or self.root.is_dir(), "root", "a folder", self.root)

    @property
    def report_file(self) -> Path:
        """File for the losses."""
        return self.report or self.target.with_name(f"{self.target.name}.losses.json")


@dataclass(frozen=True)
class CheckOptions:
    """Renders scene files as converted for Mitsuba 3 and for LuxCore, and compares the pictures."""

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[SCENE ...]")] = ()
    """Scene files; those of LuxRender and Mitsuba are also rendered as they are."""
    markers: bool = False
    """Check the places of known lamps in the pictures, from every format to every other."""
    matrix: bool = False
    """Compare every light, material and medium in every pair of formats."""
    formats: Annotated[
        tuple[str, ...], tyro.conf.arg(help=f"Formats of the matrix: {', '.join(FORMATS_OF)}; by default all.")
    ] = ()
    groups: tuple[str, ...] = ()
    """Scenes of the matrix: materials, media, "media in the sun", fog or lights by name; by default all."""
    mutations: int = 0
    """Change the scene files (by default the Cornell boxes) at random so many times, read each and count failures,
    instead of rendering. A run in the same folder goes on where an earlier one was."""
    seed: int = 0
    """Seed of all random numbers; those of the changes."""
    plain: bool = False
    """Also compare both renderers on each scene with every surface matte: a difference is then not due to materials."""
    width_px: int = 160
    """Width, pixels; the height follows from the aspect of the film."""
    samples: int = 256
    """Samples per pixel."""
    root: Path | None = None
    """Folder that scenes may read from; by default their own."""
    limit_s: float = 240.0
    """Most seconds for each picture."""
    out: Path = Path("out/conversion-check")
    """Folder for the results; the scenes, pictures, table.csv, markers.csv, matrix.csv, worst.csv, pairs.csv,
    mutations.csv, pictures.jpg and summary.json."""

    def __post_init__(self) -> None:
        limits.within(self, width_px=(16, 4096), samples=(1, 1 << 16), limit_s=(1e-3, 86400.0), mutations=(0, 1 << 24),
                      seed=(0, 1 << 31))  # fmt: skip
        for name in self.formats:
            require_known(name, "formats", FORMATS_OF)
        given = bool(self.scenes) or self.markers or self.matrix or self.mutations > 0
        require(given, "scenes", "scene files, --markers, --matrix or --mutations", "none of them")
        for scene in self.scenes:
            require(scene.is_file(), "scenes", "scene files that are there", scene)
