"""Atomic writing of files: a reader never sees a partial file."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from pathlib import Path
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
    """Flushes the content of a file, or the names in a folder, to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Holds a lock that the system releases even if this process is killed."""
    with path.open("w") as file:
        lock_descriptor(file.fileno())
        yield


def plain(value: Any) -> Any:
    """A value in types of JSON: infinities become the strings ``"inf"`` and ``"-inf"``, NaN becomes null."""
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
    if isinstance(value, Path):
        return str(value)
    if value is None or isinstance(value, (str, int, float, bool)):
        return value
    raise TypeError(f"plain: cannot write a {type(value).__name__} to JSON")


def write_json(path: Path, value: Any) -> None:
    """Writes valid JSON atomically."""
    text = json.dumps(plain(value), indent=1, allow_nan=False)
    with atomic(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def write_table(path: Path, rows: pd.DataFrame) -> None:
    """Writes a data frame as CSV, atomically."""
    with atomic(path) as temporary:
        rows.to_csv(temporary, index=False)
