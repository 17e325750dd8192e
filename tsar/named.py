"""Tables of what has a name: policies, solvers, norms and whatever else people bring.

An entry is an object, or the place of one as ``module:attribute``, which is imported when it is first asked for.
Installed packages add entries through entry points of the group that a table names; Python adds them by :meth:`add`.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.metadata
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, TypeVar, cast

from tsar.checks import ConfigError

Entry = TypeVar("Entry")


@dataclass(frozen=True)
class Origin:
    """Where an entry comes from.

    Attributes:
        module: that it is imported from, or that it was made in.
        distribution: the installed package that brought it; None where none did.
        version: of that package.
    """

    module: str
    distribution: str | None
    version: str | None


class Named(Generic[Entry]):
    """Entries by name. Changes in place when one is added.

    Attributes:
        kind: what an entry is, in one word or two, for messages.
        group: group of entry points in which installed packages offer entries.
    """

    def __init__(self, kind: str, group: str, entries: dict[str, Entry | str]) -> None:
        """Takes the project's own entries."""
        self.kind, self.group = kind, group
        self._entries: dict[str, Entry | str] = dict(entries)
        self._places: dict[str, str] = {name: place for name, place in entries.items() if isinstance(place, str)}
        self._own = set(entries)
        self._brought_by: dict[str, importlib.metadata.Distribution] = {}
        self._searched = False

    def add(self, name: str, entry: Entry | str) -> None:
        """Adds an entry, or puts it in the place of the one of that name."""
        self._entries[name] = entry
        self._places.pop(name, None)
        self._brought_by.pop(name, None)
        self._own.discard(name)
        if isinstance(entry, str):
            self._places[name] = entry

    @contextmanager
    def lent(self, **entries: Entry | str) -> Iterator[None]:
        """Holds further entries for the length of a block; then the table is as it was before."""
        self._search()  # what is found within the block would be forgotten after it
        before = dict(self._entries), dict(self._places), set(self._own), dict(self._brought_by)
        for name, entry in entries.items():
            self.add(name, entry)
        try:
            yield
        finally:
            self._entries, self._places, self._own, self._brought_by = before

    def names(self) -> tuple[str, ...]:
        """All names: the project's own first, then those that were added, then those of installed packages."""
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
            ConfigError: no entry has this name, or it cannot be imported; the message has the known names and the
                nearest of them.
        """
        self.require(name)
        entry = self._entries[name]
        if isinstance(entry, str):
            entry = self._entries[name] = self._imported(name, entry)
        return cast(Entry, entry)

    def require(self, name: str, field: str = "") -> None:
        """Checks a name without importing its entry.

        Args:
            name: to be found.
            field: of the configuration that holds it; by default the kind of entry.

        Raises:
            ConfigError: no entry has this name.
        """
        if name in self:
            return
        near = difflib.get_close_matches(str(name), self._entries, n=1)
        hint = f" (nearest: {near[0]})" if near else ""
        known = ", ".join(self._entries)
        raise ConfigError(f"{field or self.kind}: expected one of {known}, got {name!r}{hint}")

    def is_own(self, name: str) -> bool:
        """Whether an entry is one of the project's own, rather than one that was added."""
        return name in self._own

    def origin(self, name: str) -> Origin:
        """Where an entry comes from; nothing is imported where the table holds a place.

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
        """Looks for entry points once; what has a name already stays."""
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
    """Names of the installed distributions by those of their packages; to list them takes most of a second."""
    return importlib.metadata.packages_distributions()
