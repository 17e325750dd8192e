"""Tables of what has a name: policies, solvers, norms and whatever else people bring.

An entry is an object, or the place of one as ``module:attribute``, which is imported when it is first asked for.
Installed packages add entries through entry points of the group that a table names; Python adds them by :meth:`add`.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.metadata
from collections.abc import Iterator
from typing import Any, Generic, TypeVar, cast

from tsar.config import ConfigError

Entry = TypeVar("Entry")


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
        self._modules: dict[str, str] = {}
        self._searched = False

    def add(self, name: str, entry: Entry | str) -> None:
        """Adds an entry, or puts it in the place of the one of that name."""
        self._entries[name] = entry
        self._modules.pop(name, None)

    def names(self) -> tuple[str, ...]:
        """All names: the project's own first, then those that were added, then those of installed packages."""
        self._search()
        return tuple(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self.names()

    def __iter__(self) -> Iterator[str]:
        return iter(self.names())

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

    def origin(self, name: str) -> dict[str, str | None]:
        """Where an entry comes from: its module, the distribution that holds it, and that one's version."""
        entry = self[name]
        module = self._modules.get(name) or getattr(entry, "__module__", None) or type(entry).__module__
        package = module.partition(".")[0]
        found = importlib.metadata.packages_distributions().get(package, [None])[0]
        version = importlib.metadata.version(found) if found else None
        return {"module": module, "distribution": found, "version": version}

    def _search(self) -> None:
        """Looks for entry points once; what was added by hand stays."""
        if self._searched:
            return
        self._searched = True
        for point in importlib.metadata.entry_points(group=self.group):
            self._entries.setdefault(point.name, point.value)

    def _imported(self, name: str, place: str) -> Any:
        module, _, attribute = place.partition(":")
        self._modules[name] = module
        try:
            found: Any = importlib.import_module(module)
            for part in filter(None, attribute.split(".")):
                found = getattr(found, part)
        except (ImportError, AttributeError) as error:
            raise ConfigError(f"{self.kind} {name!r}: {place} cannot be imported ({error})") from error
        return found
