"""Group conversion: the time to convert scenes of other renderers, and the memory that large ones need."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from analysis.bench.growth import exponent_row
from analysis.bench.options import BenchOptions
from analysis.bench.rows import Row, limit_row
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.geometry.ply_writing import ply_bytes
from scenes.loading import ASSETS

if TYPE_CHECKING:
    from analysis.command.progress import Bars, Task

CONVERSION_LIMIT_S = 0.5
"""Seconds that a scene may take, without copying its meshes (Hagemann 2018, sec. 5)."""

SIZES_MB = (4, 8, 16, 32)
LARGE_MB = 200
LARGE_LIMIT = 4.0
"""Peak memory of a conversion over the size of its scene: the text or mesh, its numbers, and the mesh made of them."""

ENDINGS = (".pbrt", ".lxs", ".xml")
DELIVERED = tuple(ASSETS / "cornell-box" / f"cornell-box{ending}" for ending in (".pbrt", ".xml", ".lxs"))

# the kernel's own high-water mark: that of getrusage starts with the memory of the process that started this one
_PEAK = """
import re, sys
from pathlib import Path
from scenes.formats.conversion import load_scene_file, save_scene_file
peak = lambda: 1024 * int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1])
before = peak()
save_scene_file(load_scene_file(Path(sys.argv[1])), Path(sys.argv[2]))
print(peak() - before)
"""

_HEAD = 'LookAt 0 0 5 0 0 0 0 1 0\nCamera "perspective"\nWorldBegin\n'


def conversion(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Time of a scene, growth with the size of a file, and memory of large ones."""
    task = bars.task("conversion", 2 * options.repetitions + 2)
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        yield _scenes_row(options, work, task)
        yield _growth_row(options, work, task)
        for kind in ("text", "mesh"):
            yield _memory_row(kind, work)
            task.advance()


def _scenes_row(options: BenchOptions, work: Path, task: Task) -> Row:
    files = options.scene_files or DELIVERED
    seconds = []
    for turn in range(options.repetitions + 1):
        for file in files:
            for ending in ENDINGS:
                begin = time.perf_counter()
                save_scene_file(load_scene_file(file, options.scene_root), work / f"scene{ending}")
                if turn:  # the first conversion builds the parsers
                    seconds.append(time.perf_counter() - begin)
        if turn:
            task.advance()
    name = f"scene file to another format, median of {len(files)} x {len(ENDINGS)}"
    slowest = f"slowest {max(seconds):.3f} s"
    return limit_row(Row("conversion", name, "s", 0.0, "limit", note=slowest), seconds, CONVERSION_LIMIT_S)


def relief(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a square of ``side`` points each way."""
    along = np.arange(side)
    x, y = np.meshgrid(along, along)
    points = np.stack([0.01 * x, 0.01 * y, np.sin(0.01 * x) * np.cos(0.013 * y)], axis=-1).reshape(-1, 3)
    first = (along[:-1, None] * side + along[None, :-1]).ravel()
    faces = np.concatenate(
        [
            np.stack([first, first + 1, first + side + 1], axis=1),
            np.stack([first, first + side + 1, first + side], axis=1),
        ]
    )
    return points.astype(np.float32), faces.astype(np.int32)


def write_text_scene(path: Path, megabytes: float) -> int:
    """Writes a PBRT scene of about the given size with one mesh inside the file; returns the size in bytes."""
    points, faces = relief(max(8, int((megabytes * 1e6 / 72.0) ** 0.5)))
    with path.open("w", encoding="utf-8") as file:
        file.write(f'{_HEAD}Shape "trianglemesh" "integer indices" [')
        np.savetxt(file, faces, fmt="%d")
        file.write('] "point P" [')
        np.savetxt(file, points, fmt="%.5f")
        file.write("]\nWorldEnd\n")
    return path.stat().st_size


def write_mesh_scene(path: Path, megabytes: float) -> int:
    """Writes a PBRT scene with one mesh in a separate file; returns the size of both in bytes."""
    from scenes.canonical import Mesh

    mesh = path.with_suffix(".ply")
    mesh.write_bytes(ply_bytes(Mesh(*relief(int((megabytes * 1e6 / 38.0) ** 0.5)))))
    path.write_bytes(f'{_HEAD}Shape "plymesh" "string filename" "{mesh.name}"\nWorldEnd\n'.encode())
    return mesh.stat().st_size + path.stat().st_size


def _growth_row(options: BenchOptions, work: Path, task: Task) -> Row:
    files = [work / f"text-{size}.pbrt" for size in SIZES_MB]
    sizes = [write_text_scene(file, size) for file, size in zip(files, SIZES_MB, strict=True)]
    seconds: list[list[float]] = [[] for _ in files]
    for _ in range(options.repetitions):
        for file, found in zip(files, seconds, strict=True):
            begin = time.perf_counter()
            save_scene_file(load_scene_file(file), work / "large.xml")
            found.append(time.perf_counter() - begin)
        task.advance()
    rate = sizes[-1] / median(seconds[-1]) / 1e6
    row = exponent_row("growth with the size of a text", sizes, seconds)
    return dataclasses.replace(row, group="conversion", note=f"{row.note}; {rate:.0f} MB/s")


def _memory_row(kind: str, work: Path) -> Row:
    path = work / f"{kind}.pbrt"
    size = (write_text_scene if kind == "text" else write_mesh_scene)(path, LARGE_MB)
    begin = time.perf_counter()
    root = Path(__file__).resolve().parents[2]
    command = [sys.executable, "-c", _PEAK, str(path), str(work / "out" / "scene.xml")]
    done = subprocess.run(command, cwd=root, capture_output=True, encoding="utf-8", check=True)
    seconds = time.perf_counter() - begin
    peak = float(done.stdout.split()[-1])
    name = f"peak memory of {LARGE_MB} MB as {'text' if kind == 'text' else 'a mesh file'}, over its size"
    note = f"{peak / 1e6:.0f} MB, whole process {seconds:.1f} s"
    return limit_row(Row("conversion", name, "", 0.0, "limit", note=note), [peak / size], LARGE_LIMIT)
