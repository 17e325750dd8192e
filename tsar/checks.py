"""Checks of the fields of a configuration, and the error that they raise."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import PurePath
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints


class ConfigError(ValueError):
    """A field is out of range; the message names the field, the expected values and the value given."""


def require(condition: bool, name: str, expected: str, got: object) -> None:
    """Raise :class:`ConfigError` unless the condition holds."""
    if not condition:
        raise ConfigError(f"{name}: expected {expected}, got {_in_words(got)}")


def _in_words(got: object) -> str:
    return "none" if got == () else str(got) if isinstance(got, PurePath) else repr(got)


Record = TypeVar("Record")


def closed_choices(place: str = "") -> Callable[[type[Record]], type[Record]]:
    """Makes a dataclass reject values that the ``Literal`` of a field does not list, before any other check.

    Written below ``@dataclass``. A record with such a value raises :class:`ConfigError`.

    Args:
        place: prefix of the field's name in the message.
    """

    def closed(record: type[Record]) -> type[Record]:
        own = getattr(record, "__post_init__", None)

        def __post_init__(self: Record) -> None:
            for name, many, choices in _choices(type(self)):
                value = getattr(self, name)
                ok = all(item in choices for item in value) if many else value in choices
                named = ", ".join(str(choice) for choice in choices if choice is not None)
                require(ok, place + name, f"{'some' if many else 'one'} of {named}", value)
            if own is not None:
                own(self)

        record.__post_init__ = __post_init__  # type: ignore[attr-defined]
        return record

    return closed


@cache
def _choices(record: type) -> tuple[tuple[str, bool, tuple[Any, ...]], ...]:
    """Fields with closed choices: name, whether the field is a tuple of them, and the choices."""
    found = []
    for name, kind in get_type_hints(record).items():
        many = get_origin(kind) is tuple
        item = get_args(kind)[0] if many else kind
        parts = get_args(item) if get_origin(item) in (Union, UnionType) else (item,)
        if any(get_origin(part) is Literal for part in parts):  # the only other member is None
            found.append((name, many, tuple(choice for part in parts for choice in get_args(part) or (None,))))
    return tuple(found)
