"""A file to which rows are appended one by one, each with its own checksum."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

from filelock import lock_descriptor

from analysis.storage.files import plain, sync

_CHECK_BYTES = 8
_LINE_CHECK = 2 * _CHECK_BYTES
_POLL_S = 0.005
"""Seconds between attempts of a process that waits for its turn: about as long as an append takes."""
_LOCKED_S = 10.0
"""Seconds after which a reader gives up waiting for a process that appends."""


def warn(line: str) -> None:
    """Prints a line about damage on standard error."""
    print(line, file=sys.stderr, flush=True)


class Journal:
    """Rows that are appended to a file, each on the disk before it counts; a row is a dictionary of JSON values.

    Every line begins with its checksum: a truncated or changed line is detected and ignored. Several processes may
    append to one journal.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._rows: list[dict[str, Any]] = []
        self._read = 0
        self._file: tuple[int, int] | None = None

    def rows(self) -> list[dict[str, Any]]:
        """All rows, oldest first, including those that other processes have appended since."""
        try:
            with self.path.open("rb") as file:
                found = os.fstat(file.fileno())
                if (found.st_dev, found.st_ino) != self._file or found.st_size < self._read:
                    self._rows, self._read, self._file = [], 0, (found.st_dev, found.st_ino)
                file.seek(self._read)
                fresh = _read_past_locks(file)
        except FileNotFoundError:
            self._rows, self._read, self._file = [], 0, None
            return []
        # a line without an end is being written, or was truncated
        whole = fresh[: fresh.rfind(b"\n") + 1]
        for line in whole.split(b"\n"):
            row = _row(line)
            if row is not None:
                self._rows.append(row)
            elif line:
                warn(f"{self.path}: holds a damaged line; its entry is made again")
        self._read += len(whole)
        return self._rows

    def append(self, row: Mapping[str, Any]) -> None:
        """Adds a row; it is on the disk when this returns."""
        body = json.dumps(plain(row), allow_nan=False).encode()
        line = _check(body) + b" " + body + b"\n"
        self.path.parent.mkdir(parents=True, exist_ok=True)
        created = not self.path.exists()
        with self.path.open("a+b") as file:
            lock_descriptor(file.fileno(), poll_interval=_POLL_S)
            if file.seek(0, os.SEEK_END) and _last_byte(file) != b"\n":
                line = b"\n" + line  # after a truncated line
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
        if created:
            sync(self.path.parent)


def _last_byte(file: BinaryIO) -> bytes:
    file.seek(-1, os.SEEK_END)
    return file.read(1)


def _read_past_locks(file: BinaryIO) -> bytes:
    """The rest of a file. On Windows a process that appends keeps others from the first byte, for milliseconds."""
    until_s = time.monotonic() + _LOCKED_S
    while True:
        try:
            return file.read()
        except PermissionError:
            if time.monotonic() > until_s:
                raise
            time.sleep(_POLL_S)


def _check(body: bytes) -> bytes:
    return hashlib.blake2b(body, digest_size=_CHECK_BYTES).hexdigest().encode()


def _row(line: bytes) -> dict[str, Any] | None:
    body = line[_LINE_CHECK + 1 :]
    return json.loads(body) if line[: _LINE_CHECK + 1] == _check(body) + b" " else None
