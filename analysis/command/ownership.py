"""Locks on folders: one process writes to a folder at a time."""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO


@contextmanager
def owned(path: Path, what: str) -> Iterator[None]:
    """Holds a lock file for this process alone, and writes the name of this process into it.

    The system releases the lock even if this process is killed. The file stays, because removing it would let two
    processes each lock a file of that name.

    Raises:
        ValueError: another process holds it; the message names ``what``, the folder and the process.
    """
    with _taken(path, what):
        yield


def _taken(path: Path, what: str) -> TextIO:
    """A lock file that names this process, which holds it until the file is closed."""
    from filelock import lock_descriptor  # here, so that a Python without packages can say that they are missing

    while True:
        file = path.open("a+", encoding="utf-8")
        if not lock_descriptor(file.fileno(), blocking=False):
            file.seek(1)  # on Windows nobody else may read the first byte, which is locked
            owner = " ".join(file.read(300).split()) or "another process"
            file.close()
            raise ValueError(f"{what}: {path.parent} is in use by {owner}") from None
        if _is(path, file):
            break
        file.close()  # its last owner removed it in the meantime
    now, command = time.strftime("%Y-%m-%d %H:%M:%S"), " ".join(sys.argv)[:160]
    file.truncate(0)
    file.write(f" process {os.getpid()} on {socket.gethostname()} since {now}: {command}\n")
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
        ValueError: the folder cannot be created or written, or another process writes there; the message says which.
    """
    folder = writable_folder(path, what).resolve()
    if folder not in _owned_folders:
        _owned_folders[folder] = _taken(folder / _OWNER, what)
    return path


def release_folders() -> None:
    """Releases all folders that this process owns."""
    for folder in list(_owned_folders):
        release_folder(folder)


def release_folder(path: Path) -> None:
    """Releases a folder, if this process owns it."""
    folder = path.resolve()
    if folder in _owned_folders:
        with suppress(OSError):
            with _owned_folders.pop(folder):
                try:
                    return (folder / _OWNER).unlink()
                except PermissionError:
                    pass  # Windows keeps a file that is open
            (folder / _OWNER).unlink()


def writable_folder(path: Path, what: str) -> Path:
    """Creates a folder and checks that files can be written there.

    Raises:
        ValueError: the path is a file, or cannot be created or written; the message names ``what`` and the path.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / f".probe{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ValueError(f"{what}: cannot write to {str(path)!r} ({error.strerror or error})") from None
    return path
