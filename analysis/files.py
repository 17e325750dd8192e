"""Writing files so that a reader never sees half of one."""

from __future__ import annotations

import fcntl
import json
import math
import os
import socket
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, TextIO

import numpy as np

PARTIAL = ".partial"
"""Ending of the name a file has while it is being written."""


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A temporary name beside ``path``, moved there when the block ends well and removed when it does not.

    The folder is created. When the block has ended, content and name are on the disk, not only in memory.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # the ending stays last: writers choose the format by it
    temporary = path.with_name(f"{path.stem}{PARTIAL}{path.suffix}")
    try:
        yield temporary
        # in this order: after a power cut the name must not stand for an empty file
        sync(temporary)
        os.replace(temporary, path)
        sync(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def sync(path: Path) -> None:
    """Has the system put the content of a file, or the names in a folder, on the disk before this returns."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Holds a lock that the system releases even if this process is killed."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


@contextmanager
def owned(path: Path, what: str) -> Iterator[None]:
    """Holds a lock file for this process alone, and writes into it who that is.

    The system releases the lock even if this process is killed. The file stays: one that is removed could be held by
    two at once.

    Raises:
        ValueError: another process holds it; the message names ``what``, the folder and who.
    """
    with _taken(path, what):
        yield


def _taken(path: Path, what: str) -> TextIO:
    """A lock file that this process holds until it is closed, with who that is in it."""
    while True:
        file = path.open("a+", encoding="utf-8")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            owner = " ".join(file.read(300).split()) or "another process"
            file.close()
            raise ValueError(f"{what}: {path.parent} is in use by {owner}") from None
        if _is(path, file):
            break
        file.close()  # its last owner removed it meanwhile
    now, command = time.strftime("%Y-%m-%d %H:%M:%S"), " ".join(sys.argv)[:160]
    file.truncate(0)
    file.write(f"process {os.getpid()} on {socket.gethostname()} since {now}: {command}\n")
    file.flush()
    return file


def _is(path: Path, file: TextIO) -> bool:
    try:
        return os.path.samestat(os.stat(path), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


_OWNER = ".owner"
_owned_folders: dict[Path, TextIO] = {}


def own_folder(path: Path, what: str) -> Path:
    """Creates a folder that this process alone writes results to, until :func:`release_folders` or its end.

    Raises:
        ValueError: it cannot be created or written, or another process writes there; the message says which.
    """
    folder = writable_folder(path, what).resolve()
    if folder not in _owned_folders:
        _owned_folders[folder] = _taken(folder / _OWNER, what)
    return path


def release_folders() -> None:
    """Gives back all folders that this process owns."""
    while _owned_folders:
        folder, file = _owned_folders.popitem()
        with file, suppress(OSError):
            (folder / _OWNER).unlink()


def writable_folder(path: Path, what: str) -> Path:
    """Creates a folder and checks that files can be written there.

    Raises:
        ValueError: it is a file, or cannot be created or written; the message names ``what`` and the path.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / f".probe{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ValueError(f"{what}: cannot write to {str(path)!r} ({error.strerror or error})") from None
    return path


def plain(value: Any) -> Any:
    """A value made of what JSON knows: infinities become the strings ``"inf"`` and ``"-inf"``, NaN becomes null."""
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
