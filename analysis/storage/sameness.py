"""Comparison of two folders of results: every number, table and picture, except measured seconds."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.storage.store import shortened

if TYPE_CHECKING:
    import pyarrow as pa

MEASURED = (
    *("provenance", "start", "machine", "stage_wall_s", "wall", "wall_s"),
    *("samples_per_s", "created", "peak_memory_bytes"),
)
"""Entries of JSON files that differ between two equal runs: place, date and speed of the run."""

_PICTURES = (".png", ".ppm", ".exr")
_NOT_COMPARED = (".html", ".log", ".lock", ".journal")
_TIMES = "timing.csv"


@dataclass
class Difference:
    """The differences between two folders. Grows in place.

    Attributes:
        compared: number of files that are in both folders and were compared.
        found: a line for each difference, with the file and the place in it.
        left_out: files that contain measured seconds, and so were not compared.
    """

    compared: int = 0
    found: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def compare_folders(first: Path, second: Path, ignore: tuple[str, ...] = ()) -> Difference:
    """Compares all files of two folders by their content.

    Args:
        first, second: folders that the same command wrote.
        ignore: names of files, and of entries of JSON files and tables, that are left out beside :data:`MEASURED`.

    Raises:
        ValueError: one of them is not a folder, or neither contains a file.
    """
    for folder in (first, second):
        if not folder.is_dir():
            raise ValueError(f"{folder}: expected a folder of results")
    names = sorted({file.relative_to(folder) for folder in (first, second) for file in _files(folder)})
    if not names:
        raise ValueError(f"{first}, {second}: expected results, found no files")
    difference = Difference()
    for name in names:
        if name.suffix in _NOT_COMPARED or name.name in (_TIMES, *ignore):
            difference.left_out.append(str(name))
            continue
        missing = [str(folder) for folder in (first, second) if not (folder / name).is_file()]
        if missing:
            difference.found.append(f"{name}: missing in {' and '.join(missing)}")
            continue
        difference.compared += 1
        difference.found += [f"{name}: {line}" for line in _compare(first / name, second / name, ignore)]
    return difference


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))


def _compare(first: Path, second: Path, ignore: tuple[str, ...]) -> Iterator[str]:
    if first.read_bytes() == second.read_bytes():
        return
    left_out = {*MEASURED, *ignore}
    if first.suffix == ".json":
        yield from _of_values(json.loads(first.read_bytes()), json.loads(second.read_bytes()), left_out)
    elif first.suffix == ".parquet":
        yield from _of_tables(first, second, left_out)
    elif first.suffix in _PICTURES:
        yield from _of_pictures(first, second)
    else:
        yield "other bytes"


def _of_values(a: Any, b: Any, ignore: set[str], place: str = "") -> Iterator[str]:
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        for key in sorted({*a, *b}):
            if key in ignore or (key == "out" and place == "config"):
                continue
            inner = f"{place}.{key}" if place else key
            if key not in a or key not in b:
                yield f"{inner}: only in one of them"
            else:
                yield from _of_values(a[key], b[key], ignore, inner)
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for number, (left, right) in enumerate(zip(a, b, strict=True)):
            yield from _of_values(left, right, ignore, f"{place}[{number}]")
    elif a != b:
        yield f"{place}: {shortened(a)} and {shortened(b)}"


def _of_tables(first: Path, second: Path, ignore: set[str]) -> Iterator[str]:
    import pyarrow.parquet as pq

    a, b = pq.read_table(first), pq.read_table(second)
    # the measured seconds of each stage have a column
    kept = [name for name in a.column_names if name not in ignore and not name.startswith("stage_")]
    for name in kept:
        if name not in b.column_names:
            yield f"column {name}: only in {first.parent}"
        elif not _same_column(a.column(name).combine_chunks(), b.column(name).combine_chunks()):
            yield f"column {name}: other values"
    yield from (f"column {name}: only in {second.parent}" for name in b.column_names if name not in a.column_names)


def _same_column(a: pa.Array, b: pa.Array) -> bool:
    """Whether all values are equal, with lists compared item by item; NaN equals NaN."""
    import pyarrow as pa

    if a.equals(b) or a.type != b.type or len(a) != len(b):
        return a.equals(b)
    if pa.types.is_list(a.type):
        return a.value_lengths().equals(b.value_lengths()) and _same_column(a.flatten(), b.flatten())
    return pa.types.is_floating(a.type) and np.array_equal(a.to_numpy(False), b.to_numpy(False), equal_nan=True)


def _of_pictures(first: Path, second: Path) -> Iterator[str]:
    a, b = _pixels(first), _pixels(second)
    if a.shape != b.shape:
        yield f"{a.shape} and {b.shape} pixels"
    elif not np.array_equal(a, b):
        yield f"{int((a != b).sum())} of {a.size} values of its pixels differ"


def _pixels(path: Path) -> np.ndarray:
    if path.suffix == ".exr":
        import OpenEXR

        with OpenEXR.File(str(path)) as file:
            return np.concatenate([np.atleast_3d(c.pixels) for c in file.channels().values()], axis=2)
    from PIL import Image

    return np.asarray(Image.open(path))
