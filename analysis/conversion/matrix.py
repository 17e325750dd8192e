"""Every light, material and medium in every pair of formats, compared by the pictures of the formats' own renderers.

A specimen is written in one format, converted to another, and both files are drawn. Mitsuba 3 draws files of Mitsuba 3
and, with their tree upgraded, of Mitsuba 0.5; LuxCore draws those of LuxRender. PBRT, glTF and USD have no engine here:
their files are read again and drawn by Mitsuba 3.
"""

from __future__ import annotations

import dataclasses
import hashlib
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.command.progress import Task
from analysis.conversion.media_specimens import fog, media_in_sun, media_under_sky
from analysis.conversion.options import FORMATS_OF
from analysis.conversion.peers import ENGINES, RenderedImage, drawn, rendered
from analysis.conversion.specimens import CELL_PX, DISTANT, LAMPS, Specimens, distant, lamp, materials
from scenes.canonical import Scene
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport

BOUND = 0.02
"""Relative difference above which a cell is called off."""

FINER = 8
"""How many times as many samples pairs get that differ more, without a loss that says so: it may be noise."""

_GONE = re.compile(r'type="(phong|ward|difftrans|mixturebsdf|roughdiffuse|sun|sky|sunsky)"')

_SKY = "light all around"  # which glTF loses, and gets back
_DIM = 0.1  # of the mean of a specimen, below which differences count as of this share


Known = dict[tuple[str, ...], tuple[Scene, tuple[str, ...], str]]
"""The scene after some formats, what it lost, and the plugin that Mitsuba 3 lacks, by the formats."""


@dataclass
class Gallery:
    """Draws files, each content once.

    Attributes:
        folder: folder for files and pictures.
        samples: samples per pixel.
        limit_s: most seconds for each picture.
        like: the specimens; glTF files get back what the format has not (:func:`read`).
    """

    folder: Path
    samples: int
    limit_s: float
    like: Specimens
    _drawn: dict[tuple[str, int], RenderedImage | str] = field(default_factory=dict)
    _again: dict[Path, Path] = field(default_factory=dict)

    def pictures(self, shown: Iterable[tuple[str, Path]], finer: int = 1) -> list[RenderedImage | str]:
        """The pictures of files of formats, with ``finer`` times the samples."""
        named = [self._named(kind, file) for kind, file in shown]
        todo = {(name, engine): file for name, engine, file in named if (name, finer) not in self._drawn}
        size_px, samples, limit_s = self.like.size_px, finer * self.samples, finer * self.limit_s
        for program in dict.fromkeys(engine for _, engine in todo):
            files = {self.folder / f"{name}-{finer}.npy": (name, file)
                     for (name, engine), file in todo.items() if engine == program}  # fmt: skip
            made = drawn(program, [(file, out) for out, (_, file) in files.items()], size_px, samples, limit_s)
            for out, (name, file) in files.items():
                found = made[out] if out in made else rendered(program, file, out, size_px, samples, limit_s)
                self._drawn[name, finer] = found
        return [self._drawn[name, finer] for name, _, _ in named]

    def _named(self, kind: str, file: Path) -> tuple[str, str, Path]:
        """A name for the content of a file, its renderer, and the file that this draws."""
        if kind not in ENGINES:
            if file not in self._again:
                self._again[file] = file.with_name(f"{file.stem}-of-{kind}.xml")
                save_scene_file(read(file, self.like.scene, self.like.sky), self._again[file], "mitsuba3")
            kind, file = "mitsuba3", self._again[file]
        return hashlib.blake2b(kind.encode() + file.read_bytes(), digest_size=8).hexdigest(), ENGINES[kind], file


GROUPS: dict[str, Callable[[], Specimens]] = {
    "materials": materials,
    **{name: partial(lamp, name) for name in LAMPS},
    **{name: partial(distant, name) for name in DISTANT},
    "media": media_under_sky,
    "media in the sun": media_in_sun,
    "fog": fog,
}
"""The scenes of the matrix by name."""


def matrix_rows(
    folder: Path,
    samples: int,
    limit_s: float,
    task: Task,
    groups: tuple[str, ...] = tuple(GROUPS),
    formats: tuple[str, ...] = tuple(FORMATS_OF),
) -> list[dict[str, Any]]:
    """A row for each specimen and each pair of formats, and for each format in which a specimen is written first.

    Args:
        folder: folder for the files and pictures, a folder in it for each group.
        samples: samples per pixel.
        limit_s: most seconds for each picture.
        task: progress, a step a group.
        groups: names in ``GROUPS``.
        formats: names in ``FORMATS_OF``.
    """
    rows: list[dict[str, Any]] = []
    for name in groups:
        work = folder / name.replace(", ", "-").replace(" ", "-")
        work.mkdir(parents=True, exist_ok=True)
        found = GROUPS[name]()
        rows += _rows(found, Gallery(work, samples * found.effort, limit_s, found), formats)
        task.advance()
    return rows


def read(file: Path, like: Scene, sky: bool, report: LossReport | None = None) -> Scene:
    """The scene of a file; that of glTF and USD gets the depth of paths of another scene, and with ``sky`` that of glTF
    its lights."""
    scene = load_scene_file(file, None, report)
    if file.suffix in (FORMATS_OF["gltf"], FORMATS_OF["usd"]):
        scene = dataclasses.replace(scene, integrator=like.integrator)
    if sky and file.suffix == FORMATS_OF["gltf"]:
        scene = dataclasses.replace(scene, lights=like.lights, ambient=(0.0,) * 3, background=None)
    return scene


def _rows(found: Specimens, gallery: Gallery, formats: tuple[str, ...]) -> Iterator[dict[str, Any]]:
    scenes: dict[str, Scene] = {"scene": found.scene}
    files = {(source, target): gallery.folder / f"{source}-to-{target}{FORMATS_OF[target]}"
             for source in ("scene", *formats) for target in formats}  # fmt: skip
    shown = {target: (target, files["scene", target]) for target in formats}
    shown["scene"] = shown.get("mitsuba3", shown[formats[0]])
    gone: dict[str, Known] = {}
    for (source, target), file in files.items():
        save_scene_file(scenes[source], file, target)
        if source == "scene":
            scenes[target] = read(file, found.scene, found.sky)
    gallery.pictures((target, file) for (_, target), file in files.items())  # all at once
    for (source, target), file in files.items():
        pair = shown[source], (target, file)
        off = differences(found, *gallery.pictures(pair))
        ways = {name: losses(one, source, target, gallery.folder, gone.setdefault(name, {}), found.sky)
                for name, one in found.single.items()}  # fmt: skip
        if any(off[name][0] > BOUND and not lost and not undrawn for name, (lost, undrawn) in ways.items()):
            off = differences(found, *gallery.pictures(pair, FINER))
        for name, (lost, undrawn) in ways.items():
            value, note = (float("nan"), undrawn) if undrawn else off[name]
            yield {"specimen": name, "from": source, "to": target, "off": value, "note": note, "losses": lost}


def losses(
    scene: Scene, source: str, target: str, folder: Path, known: Known | None = None, sky: bool = False
) -> tuple[list[str], str]:
    """What a conversion says to have lost of the picture, with the losses of the ways to renderers, and a plugin that
    Mitsuba 3 does not have, so that the file of Mitsuba 0.5 cannot be drawn."""
    ways = [(source, target), (source,)]
    found = [
        _after(scene, way if way[-1] in ENGINES else (*way, "mitsuba3"), folder, {} if known is None else known, sky)
        for way in ways
    ]
    lost = dict.fromkeys(loss for one in found for loss in one[1])
    return list(lost), next((one[2] for one in found if one[2]), "")


def _after(
    scene: Scene, way: tuple[str, ...], folder: Path, known: Known, sky: bool
) -> tuple[Scene, tuple[str, ...], str]:
    """A scene after some formats, what it lost on the way, and the missing plugin; each way is gone once."""
    if way in ((), ("scene",)):
        return scene, (), ""
    if way not in known:
        before, lost, undrawn = _after(scene, way[:-1], folder, known, sky)
        report, file = LossReport(), folder / f"single{FORMATS_OF[way[-1]]}"
        save_scene_file(before, file, way[-1], report)
        after = read(file, scene, sky, report)
        told = (loss for loss in report.losses if loss.picture and not (sky and loss.what == _SKY))
        lost += tuple(f"{loss.what}: {loss.became}" for loss in told)
        if way[-1] == "mitsuba" and (gone := _GONE.search(file.read_text(encoding="utf-8"))):
            undrawn = f"Mitsuba 3 has no plugin {gone[1]!r}"
        known[way] = after, lost, undrawn
    return known[way]


def differences(
    found: Specimens, first: RenderedImage | str, second: RenderedImage | str
) -> dict[str, tuple[float, str]]:
    """For each specimen, how far its second picture is from the first, relative, and why there is none.

    Each colour of each quarter counts, of lamps, or of each cell; the greatest difference is returned.
    """
    for one in (first, second):
        if isinstance(one, str):
            return dict.fromkeys(found.cells, (float("nan"), one))
    assert not isinstance(first, str) and not isinstance(second, str)
    made: dict[str, tuple[float, str]] = {}
    for name in dict.fromkeys(found.cells):
        pair = [
            np.stack([part for cell in _cells(found, name) for part in _parts(found, picture, cell)])
            for picture in (first, second)
        ]
        least = _DIM * pair[0].mean()
        made[name] = float((np.abs(pair[1] - pair[0]) / np.maximum(pair[0], max(least, 1e-9))).max()), ""
    return made


def _cells(found: Specimens, name: str) -> list[int]:
    return [number for number, cell in enumerate(found.cells) if cell == name]


def _parts(found: Specimens, picture: RenderedImage, number: int) -> list[NDArray[np.float64]]:
    """Mean colours of a cell, or of its quarters if its middle is hidden."""
    columns = found.size_px[0] // CELL_PX
    top, left = CELL_PX * (number // columns), CELL_PX * (number % columns)
    cell = picture[top : top + CELL_PX, left : left + CELL_PX].astype(np.float64)
    away = (np.arange(CELL_PX) + 0.5) / (0.5 * CELL_PX) - 1.0
    down, across = away[:, None], away[None]
    far = np.maximum(np.abs(down), np.abs(across))
    inside = (far < found.reach) & (far >= found.hidden)
    if not found.hidden:
        return [cell[inside].mean(axis=0)]
    return [cell[inside & (x * across > 0.0) & (y * down > 0.0)].mean(axis=0) for y in (-1, 1) for x in (-1, 1)]


def worst(rows: list[dict[str, Any]], pairs: bool = False) -> list[dict[str, Any]]:
    """For each specimen, its worst pair of formats without and with a loss that is reported; or for each pair of
    formats, its worst specimen. The worst come first."""
    rows = [{**row, "pair": f"{row['from']} to {row['to']}"} for row in rows]
    own, other = ("pair", "specimen") if pairs else ("specimen", "pair")
    made = []
    for name in dict.fromkeys(row[own] for row in rows):
        found = [row for row in rows if row[own] == name and row["off"] == row["off"]]
        line: dict[str, Any] = {own: name, f"{other}s": len(found)}
        for title, reported in (("silent", False), ("reported", True)):
            part = [row for row in found if bool(row["losses"]) == reported]
            top = max(part, key=lambda row: row["off"], default=None)
            line[f"{title} beyond {BOUND:.0%}"] = sum(row["off"] > BOUND for row in part)
            line[f"worst {title}"] = float("nan") if top is None else top["off"]
            line[f"{other}, {title}"] = "" if top is None else top[other]
        made.append(line)
    return sorted(made, key=lambda line: -np.nan_to_num(line["worst silent"]))
