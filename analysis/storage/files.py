"""Atomic writing of files: a reader never sees a partial file."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

import numpy as np
from filelock import lock_descriptor

if TYPE_CHECKING:
    import pandas as pd

PARTIAL = ".partial"
"""Ending of a file's temporary name while it is being written."""


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A temporary name beside ``path``, which is renamed to ``path`` if the block succeeds and removed if it fails.

    The folder is created. After the block, content and name are on the disk, not only in memory.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # the original ending stays last, because writers choose the format by it
    temporary = path.with_name(f"{path.stem}{PARTIAL}{path.suffix}")
    try:
        yield temporary
        # in this order, so that after a power cut no name refers to an empty file
        sync(temporary)
        os.replace(temporary, path)
        sync(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def sync(path: Path) -> None:
    """Flushes the content of a file, or the names in a folder, to the disk.

    Windows flushes only files that are open for writing, and no folders, whose names it keeps in a log of its own.
    """
    try:
        handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    except PermissionError:
        if path.is_dir():
            return
        raise
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Holds a lock that the system releases even if this process is killed."""
    with path.open("ab") as file:
        lock_descriptor(file.fileno())
        yield


def plain(value: Any) -> Any:
    """A value in types of JSON: infinities become the strings ``"inf"`` and ``"-inf"``, NaN becomes null, and
    a path has forward slashes."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else ("inf" if value > 0 else "-inf")
    if isinstance(value, PurePath):
        return value.as_posix()
    if value is None or isinstance(value, (str, int, float, bool)):
        return value
    raise TypeError(f"plain: cannot write a {type(value).__name__} to JSON")


def write_json(path: Path, value: Any) -> None:
    """Writes valid JSON atomically."""
    write_text(path, json.dumps(plain(value), indent=1, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Writes text atomically: the same bytes on every system, in UTF-8 and with the line ends of ``text``."""
    with atomic(path) as temporary:
        temporary.write_bytes(text.encode())


def write_table(path: Path, rows: pd.DataFrame) -> None:
    """Writes a data frame as CSV, atomically."""
    with atomic(path) as temporary:
        rows.to_csv(temporary, index=False, lineterminator="\n")
