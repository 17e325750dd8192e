"""Answers of a session on disk. An acknowledged answer is not lost if the process is killed or the disk is full.

The store is one SQLite file. An answer is acknowledged once its transaction is on disk. Every row carries a seal, a
SHA-256 over the previous seal and its own text, and the last seal is stored with the number of answers. A row that
anything but this module changes, removes or adds is therefore detected when the store is opened.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import secrets
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from analysis.command.cli import InputError
from analysis.storage.files import atomic, sync

_TABLES = """
create table session (id integer primary key, identity text not null, token text not null,
                      answers integer not null, seal text not null);
create table answers (id integer primary key, body text not null);
"""


class Answers:
    """The store of one session, opened by one process at a time."""

    def __init__(self, file: Path, identity: Mapping[str, Any], earlier: Iterable[Mapping[str, Any]] = ()) -> None:
        """Opens a store and checks all of it, or creates one.

        Args:
            file: the store.
            identity: values that must be the same whenever the session is opened.
            earlier: first answers of a new store.

        Raises:
            InputError: the file is damaged, or belongs to a session with another identity.
            OSError: the file cannot be opened or written.
        """
        self.file = file
        if not file.exists():
            _create(file, json.dumps(identity, sort_keys=True), earlier)
        with self._readable():
            self._connection = _connected(file)
        try:
            with self._readable():
                found, self.token, self._count, self._seal, self._rows = self._read()
            if found != json.loads(json.dumps(identity)):
                raise InputError(
                    f"out: {file}: expected a session of {identity.get('observer')!r} with these stimuli, found another"
                )
            with self._writing():
                pass  # a store that cannot be written fails before the first trial
        except BaseException:
            self.close()
            raise

    def rows(self) -> list[dict[str, Any]]:
        """All answers, in the order in which they were given."""
        return [dict(row) for row in self._rows]

    def add(self, row: Mapping[str, Any]) -> None:
        """Stores an answer; it is on disk when this returns.

        Raises:
            OSError: the answer cannot be stored; the store is unchanged.
        """
        body = json.dumps(row, allow_nan=False)
        seal = _sealed(self._seal, body)
        with self._writing():
            _insert(self._connection, self._count + 1, body)
            self._connection.execute("update session set answers = ?, seal = ?", (self._count + 1, seal))
        self._count, self._seal = self._count + 1, seal
        self._rows.append(dict(row))

    def close(self) -> None:
        """Closes the store."""
        self._connection.close()

    def _read(self) -> tuple[Any, str, int, str, list[dict[str, Any]]]:
        """Identity, token, number of answers, last seal and answers.

        Raises:
            ValueError: the parts are inconsistent.
        """
        execute = self._connection.execute
        (whole,) = execute("pragma integrity_check(1)").fetchone()
        if whole != "ok":
            raise ValueError(whole)
        ((identity, token, count, last),) = execute("select identity, token, answers, seal from session").fetchall()
        bodies = [body for (body,) in execute("select body from answers order by id").fetchall()]
        seal = _sealed(_sealed("", identity), token)
        for body in bodies:
            seal = _sealed(seal, body)
        if len(bodies) != count or seal != last:
            raise ValueError("its seals do not hold")
        return json.loads(identity), token, count, seal, [json.loads(body) for body in bodies]

    @contextlib.contextmanager
    def _readable(self) -> Iterator[None]:
        """Raises InputError, naming the file, if the block does not read a complete store."""
        try:
            yield
        except (sqlite3.Error, ValueError, TypeError) as error:
            raise InputError(
                f"out: {self.file}: expected the answers of a session, found a damaged file ({error})"
            ) from None

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """A transaction: on disk if the block succeeds, undone if it fails.

        Raises:
            OSError: the disk is full, the file may not be written, …
        """
        try:
            self._connection.execute("begin immediate")
            yield
            self._connection.execute("commit")
        except sqlite3.Error as error:
            raise OSError(errno.EIO, str(error), str(self.file)) from error
        finally:
            if self._connection.in_transaction:
                with contextlib.suppress(sqlite3.Error):  # what cannot be undone now is undone when the file is opened
                    self._connection.execute("rollback")


def _connected(file: Path) -> sqlite3.Connection:
    """A connection without implicit transactions that waits for the disk at the end of each one."""
    # between two answers a session is one file, so that a copy of it is complete; answers come from one thread at a
    # time, though not always the same one
    connection = sqlite3.connect(file, isolation_level=None, check_same_thread=False)
    try:
        connection.execute("pragma journal_mode = delete")
        connection.execute("pragma synchronous = extra")
    except sqlite3.Error:
        connection.close()
        raise
    return connection


def _create(file: Path, identity: str, earlier: Iterable[Mapping[str, Any]]) -> None:
    """Creates a store under a temporary name first, so that an existing store is always complete."""
    bodies = [json.dumps(row, allow_nan=False) for row in earlier]
    token = secrets.token_urlsafe(32)
    seal = _sealed(_sealed("", identity), token)
    for body in bodies:
        seal = _sealed(seal, body)
    try:
        with atomic(file) as temporary:
            for left in (temporary, temporary.with_name(f"{temporary.name}-journal")):
                left.unlink(missing_ok=True)
            with contextlib.closing(_connected(temporary)) as connection:
                connection.executescript(f"begin; {_TABLES}")
                for number, body in enumerate(bodies, 1):
                    _insert(connection, number, body)
                values = identity, token, len(bodies), seal
                connection.execute("insert into session values (1, ?, ?, ?, ?)", values)
                connection.execute("commit")
        sync(file.parent)
    except sqlite3.Error as error:
        raise OSError(errno.EIO, str(error), str(file)) from error


def _insert(connection: sqlite3.Connection, number: int, body: str) -> None:
    connection.execute("insert into answers values (?, ?)", (number, body))


def _sealed(before: str, text: str) -> str:
    return hashlib.sha256(f"{before}\n{text}".encode()).hexdigest()


def answers_of_lines(file: Path) -> list[dict[str, Any]]:
    """Answers of a file that earlier versions wrote, one JSON object a line; the first answer to each trial counts.

    An interrupted write was never acknowledged: its remains, at the end of the file or before the next answer, are
    ignored.

    Raises:
        InputError: a line holds anything else.
    """
    decoder, found = json.JSONDecoder(), dict[int, dict[str, Any]]()
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    for number, line in enumerate(map(str.strip, lines), 1):
        at = 0
        while at < len(line):
            try:
                row, at = decoder.raw_decode(line, at)
                if not (isinstance(row["trial"], int) and row["answer"] in ("left", "right")):
                    raise ValueError
                found.setdefault(row["trial"], row)
            except (ValueError, KeyError, TypeError, RecursionError):
                following = line.find(_BEGIN, at + 1)
                begun = line[at:] if following < 0 else line[at:following]
                if not _BEGIN.startswith(begun[: len(_BEGIN)]) or (following < 0 and number < len(lines)):
                    raise InputError(f"{file}:{number}: expected an answer, got {line[:60]!r}") from None
                at = len(line) if following < 0 else following
    return list(found.values())


_BEGIN = '{"trial": '
