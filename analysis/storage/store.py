"""Files made by commands: each is listed with its checksum before it counts, and checked when it is read.

A :class:`Store` is a folder and a key, the hash of everything that decides the content of its files. The folder's list,
``files.journal``, names every file that was ever made there, with its key, its checksum and facts about it, such as the
number of its non-finite values. A file counts only if the list has it under the store's key and its content matches the
checksum. A file that is missing, truncated or of another key counts as missing. So does a file whose content has
changed, which is reported in a line on standard error. A process may be killed at any moment: files that count are
complete, and the others are made again.

A command that keeps files looks for them, makes missing ones, and reads checked ones::

    store = Store(options.out, config_hash)
    for number, name in enumerate(names):
        found = store.find(name)
        if found is None:
            with store.make(name) as found:
                found.facts["nonfinite"] = write_image(found.path, picture(number))
        nonfinite += found.facts["nonfinite"]

``find`` checks the file and returns its entry, ``read`` returns the checked bytes, and ``read_json`` the checked value
of a JSON file. ``listed`` names the files that commands made in the folder: ``discard`` deletes only those.

:func:`read_json` of this module reads JSON from elsewhere: invalid JSON, and valid JSON of another form, give an error
of one line.
"""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from analysis.storage.files import atomic, plain
from analysis.storage.journal import Journal, warn

JOURNAL = "files.journal"
"""Name of a folder's list of files."""


@dataclass(frozen=True)
class Entry:
    """A file as it was made.

    Attributes:
        name: path within the folder, with forward slashes.
        key: key of the store that made it.
        sha256: SHA-256 of its content.
        facts: further values, by name.
    """

    name: str
    key: str
    sha256: str
    facts: Mapping[str, Any]


class _Files:
    """The entries of a journal by name. Changes in place as the journal grows."""

    def __init__(self, journal: Journal) -> None:
        self.journal = journal
        self._rows, self._indexed = journal.rows(), 0
        self._entries: dict[str, list[Entry]] = {}

    def entries(self) -> dict[str, list[Entry]]:
        """The entries of every file, oldest first."""
        rows = self.journal.rows()
        if rows is not self._rows:
            self._rows, self._indexed, self._entries = rows, 0, {}
        for row in rows[self._indexed :]:
            if "name" not in row:  # reserved names; see analysis.storage.results
                continue
            if row.get("discarded"):
                self._entries.pop(row["name"], None)
            else:
                entry = Entry(row["name"], row["key"], row["sha256"], row["facts"])
                self._entries.setdefault(entry.name, []).append(entry)
        self._indexed = len(rows)
        return self._entries


@dataclass
class Making:
    """A file in the making: its temporary path, and facts about it. Changes in place."""

    path: Path
    facts: dict[str, Any] = field(default_factory=dict)


class Store:
    """The files of one key in a folder. Processes that may make the same file at the same time need a further lock."""

    def __init__(self, folder: Path, key: str, say: Callable[[str], None] = warn) -> None:
        """Opens a folder, which need not exist.

        Args:
            folder: folder of the files.
            key: hash of everything that decides their content.
            say: called with a line about each damaged file.
        """
        self.folder, self.key, self._say = folder, key, say
        self._files = _Files(Journal(folder / JOURNAL))
        self._warned: set[str] = set()

    def under(self, key: str) -> Store:
        """The same folder under another key; its list is read once for both."""
        other = copy.copy(self)
        other.key = key
        return other

    @contextmanager
    def make(self, name: str) -> Iterator[Making]:
        """Makes or replaces a file: the block writes it to the ``path`` of the yielded object, and may add facts.

        If the block succeeds, the file appears under its name and counts; otherwise nothing changes.
        """
        with atomic(self.folder / name) as temporary:
            making = Making(temporary)
            yield making
            # listed first: if the process is killed here, the file counts as missing, never as someone else's
            entry = Entry(name, self.key, _digest(temporary), making.facts)
            self._files.journal.append(asdict(entry))

    def add(self, name: str, **facts: Any) -> None:
        """Lists a file that is already in its place, complete and on the disk, as left by
        :func:`~analysis.storage.files.atomic`.

        An earlier file of that name is lost if the process is killed before this call; :meth:`make` avoids that.
        """
        self._files.journal.append(asdict(Entry(name, self.key, _digest(self.folder / name), facts)))

    def write_json(self, name: str, value: Any, **facts: Any) -> None:
        """Makes a JSON file, with infinities and NaN as in :func:`analysis.storage.files.plain`."""
        text = json.dumps(plain(value), indent=1, allow_nan=False)
        with self.make(name) as making:
            making.path.write_bytes(f"{text}\n".encode())
            making.facts |= facts

    def find(self, name: str) -> Entry | None:
        """The entry of a file that is intact on disk under this key, or None."""
        return self._checked(name, _digest)

    def read(self, name: str) -> bytes | None:
        """The content of a file that is intact on disk under this key, or None."""
        content = b""

        def digest(path: Path) -> str:
            nonlocal content
            content = path.read_bytes()
            return hashlib.sha256(content).hexdigest()

        return None if self._checked(name, digest) is None else content

    def read_json(self, name: str, expected: Any) -> Any:
        """The value of a JSON file that is intact on disk under this key, or None.

        Raises:
            ValueError: the value is not what was expected; see :func:`read_json`.
        """
        content = self.read(name)
        return None if content is None else parse_json(content, expected, str(self.folder / name))

    def listed(self) -> set[str]:
        """Names of the files that were made in the folder under any key and have not been discarded."""
        return set(self._files.entries())

    def require_own(self, names: Iterable[str]) -> None:
        """Raises ValueError if one of the names belongs to a file that is not on the list and would be overwritten."""
        listed = self.listed()
        for name in names:
            if name not in listed and (self.folder / name).exists():
                raise ValueError(f"{self.folder / name}: expected no file that this command did not make; move it")

    def discard(self, names: Iterable[str]) -> list[str]:
        """Deletes those of the files that are on the list and unchanged; returns their names.

        A file that was changed since stays, is named in a line, and is removed from the list.
        """
        gone = []
        for name in sorted(self.listed().intersection(names)):
            file, written = self.folder / name, {entry.sha256 for entry in self._files.entries()[name]}
            if file.exists() and _digest(file) not in written:
                warn(f"{file}: was changed since it was written; it stays")
            else:
                file.unlink(missing_ok=True)
                gone.append(name)
            self._files.journal.append({"name": name, "discarded": True})
        return gone

    def discard_outdated(self, pattern: str) -> list[str]:
        """Deletes files that match a pattern and that only other keys made; returns their names and reports their
        number."""
        keys = {name: {entry.key for entry in entries} for name, entries in self._files.entries().items()}
        gone = self.discard(name for name, found in keys.items() if self.key not in found and fnmatch(name, pattern))
        if gone:
            warn(f"{self.folder}: {len(gone)} files of an earlier run with other input or code were removed")
        return gone

    def _checked(self, name: str, digest_of: Callable[[Path], str]) -> Entry | None:
        """The newest entry of this key whose content is on disk. Reports a file whose content no key wrote."""
        entries = self._files.entries().get(name, [])
        if not any(entry.key == self.key for entry in entries):
            return None
        try:
            digest = digest_of(self.folder / name)
        except FileNotFoundError:
            return None
        except OSError as error:
            digest = str(error)
        same = [entry for entry in entries if entry.sha256 == digest]
        if not same and name not in self._warned:
            self._warned.add(name)
            self._say(f"{self.folder / name}: is damaged, or was changed since it was written; it is made again")
        return next((entry for entry in reversed(same) if entry.key == self.key), None)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_json(path: Path, expected: Any) -> Any:
    """The value of a JSON file.

    Args:
        path: path of the file.
        expected: a type, such as ``list[float]``; or a dictionary from required keys to the expectation for each
            value, with further keys allowed; or a list with the expectation for every item.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is not JSON, or not as expected; the message names the file and the place.
    """
    return parse_json(path.read_bytes(), expected, str(path))


def parse_json(content: bytes, expected: Any, where: str) -> Any:
    """The value of a JSON text; arguments and errors as in :func:`read_json`, and ``where`` names the text."""
    try:
        value = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{where}: expected JSON ({error})") from None
    _require(value, expected, where)
    return value


def _require(value: Any, expected: Any, where: str) -> None:
    from typeguard import CollectionCheckStrategy, TypeCheckError, check_type

    if isinstance(expected, Mapping):
        if not isinstance(value, dict):
            raise ValueError(f"{where}: expected an object with {', '.join(expected)}, got {shortened(value)}")
        for key, inner in expected.items():
            if key not in value:
                raise ValueError(f"{where}: expected {key!r}, got only {shortened(list(value))}")
            _require(value[key], inner, f"{where}: {key}")
        return
    if isinstance(expected, list):
        _require(value, list, where)
        for number, item in enumerate(value):
            _require(item, expected[0], f"{where}: {number}")
        return
    try:
        check_type(value, expected, collection_check_strategy=CollectionCheckStrategy.ALL_ITEMS)
    except TypeCheckError:
        name = expected.__name__ if isinstance(expected, type) and not hasattr(expected, "__args__") else expected
        raise ValueError(f"{where}: expected {name}, got {shortened(value)}") from None


def shortened(value: Any) -> str:
    """A JSON value as text of at most 60 characters."""
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
