"""Tables of named entries: policies, solvers, norms and other extensions.

An entry is an object, or its import path ``module:attribute``, which is imported at the first access. Installed
packages add entries through entry points of the table's group, Python code by :meth:`Named.add`.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.metadata
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, TypeVar, cast

from tsar.checks import ConfigError

Entry = TypeVar("Entry")


def not_among(name: object, known: Iterable[str]) -> str:
    """What to say of a name that is none of the known ones: these, the name, and the nearest of them if one is near."""
    names = [name for name in known if name]  # an empty one stands for none
    near = difflib.get_close_matches(str(name), names, n=1)
    hint = f" (nearest: {near[0]})" if near else ""
    quoted = any("," in name or " " in name for name in names)  # as they are typed, so that their ends can be seen
    return f"expected one of {', '.join(repr(name) if quoted else name for name in names)}, got {name!r}{hint}"


def require_known(name: str, field: str, known: Iterable[str]) -> None:
    """Raises ConfigError if a name, the value of a field, is none of the known ones; see :func:`not_among`."""
    names = list(known)
    if name not in names:
        raise ConfigError(f"{field}: {not_among(name, names)}")


@dataclass(frozen=True)
class Origin:
    """Where an entry comes from.

    Attributes:
        module: module from which it is imported or in which it was made.
        distribution: installed package that provides it; None if there is none.
        version: of that package.
    """

    module: str
    distribution: str | None
    version: str | None


class Named(Generic[Entry]):
    """A table of entries by name. It changes in place when an entry is added.

    Attributes:
        kind: kind of the entries in one or two words, for messages.
        group: group of entry points through which installed packages provide entries.
    """

    def __init__(self, kind: str, group: str, entries: dict[str, Entry | str]) -> None:
        """Creates a table of the project's own entries."""
        self.kind, self.group = kind, group
        self._entries: dict[str, Entry | str] = dict(entries)
        self._places: dict[str, str] = {name: place for name, place in entries.items() if isinstance(place, str)}
        self._own = set(entries)
        self._brought_by: dict[str, importlib.metadata.Distribution] = {}
        self._searched = False

    def add(self, name: str, entry: Entry | str) -> None:
        """Adds an entry, or replaces the entry of that name."""
        self._entries[name] = entry
        self._places.pop(name, None)
        self._brought_by.pop(name, None)
        self._own.discard(name)
        if isinstance(entry, str):
            self._places[name] = entry

    @contextmanager
    def lent(self, **entries: Entry | str) -> Iterator[None]:
        """Adds entries for the duration of a ``with`` block, and restores the table after it."""
        self._search()  # entry points found within the block would be lost after it
        before = dict(self._entries), dict(self._places), set(self._own), dict(self._brought_by)
        for name, entry in entries.items():
            self.add(name, entry)
        try:
            yield
        finally:
            self._entries, self._places, self._own, self._brought_by = before

    def names(self) -> tuple[str, ...]:
        """All names: the project's own first, then added ones, then those of installed packages."""
        self._search()
        return tuple(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self._entries or name in self.names()

    def __iter__(self) -> Iterator[str]:
        return iter(self.names())

    def __len__(self) -> int:
        return len(self.names())

    def __getitem__(self, name: str) -> Entry:
        """The entry of a name.

        Raises:
            ConfigError: the entry cannot be imported, or no entry has this name; the message then lists the known names
                and the nearest one.
        """
        self.require(name)
        entry = self._entries[name]
        if isinstance(entry, str):
            entry = self._entries[name] = self._imported(name, entry)
        return cast(Entry, entry)

    def require(self, name: str, field: str = "") -> None:
        """Checks a name without importing its entry.

        Args:
            name: name to look up.
            field: field of the configuration that holds the name, for the message; by default the kind of entry.

        Raises:
            ConfigError: no entry has this name.
        """
        if name in self:
            return
        raise ConfigError(f"{field or self.kind}: {not_among(name, self._entries)}")

    def is_own(self, name: str) -> bool:
        """Whether an entry is one of the project's own and not an added one."""
        return name in self._own

    def origin(self, name: str) -> Origin:
        """The origin of an entry. Nothing is imported where the table holds an import path.

        Raises:
            ConfigError: no entry has this name.
        """
        self.require(name)
        entry = self._entries[name]
        module = self._places.get(name, "").partition(":")[0]
        module = module or getattr(entry, "__module__", None) or type(entry).__module__
        package = self._brought_by.get(name)
        if package is None and module != "__main__":
            found = _distributions().get(module.partition(".")[0])
            package = importlib.metadata.distribution(found[0]) if found else None
        return Origin(module, package.name, package.version) if package else Origin(module, None, None)

    def _search(self) -> None:
        """Collects entry points once; existing names are kept."""
        if self._searched:
            return
        self._searched = True
        for point in importlib.metadata.entry_points(group=self.group):
            if point.name not in self._entries:
                self._entries[point.name] = self._places[point.name] = point.value
                if point.dist is not None:
                    self._brought_by[point.name] = point.dist

    def _imported(self, name: str, place: str) -> Any:
        module, _, attribute = place.partition(":")
        try:
            found: Any = importlib.import_module(module)
            for part in filter(None, attribute.split(".")):
                found = getattr(found, part)
        except (ImportError, AttributeError) as error:
            raise ConfigError(f"{self.kind} {name!r}: {place} cannot be imported ({error})") from error
        return found


@cache
def _distributions() -> Mapping[str, list[str]]:
    """Names of the installed distributions by the names of their packages. Listing them takes most of a second."""
    return importlib.metadata.packages_distributions()
