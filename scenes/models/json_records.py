"""Checks of parsed JSON: what an object, a list or a value must be, with the path of what is not."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from scenes.canonical import SceneError

Check = Callable[[Any], None]
"""Raises :class:`Misfit` for a value that does not fit."""

GREATEST = float(np.finfo(np.float32).max)
"""Greatest magnitude of a number."""

_SHOWN_MAX = 40
_ABSENT = object()


class Misfit(Exception):
    """A value that is not what was expected.

    Attributes:
        expected: what was expected.
        value: what arrived.
        place: path from the value that was checked, such as ``.accessors[3].type``.
    """

    def __init__(self, expected: str, value: Any, place: str = "") -> None:
        super().__init__(expected)
        self.expected, self.value, self.place = expected, value, place

    def within(self, place: str) -> Misfit:
        """The same one, seen from the object or list that holds the value."""
        self.place = place + self.place
        return self


def require(value: Any, check: Check, place: str = "") -> None:
    """Checks a value, at a JSON path within its file.

    Raises:
        SceneError: it does not fit; the message has the path, what was expected and what arrived.
    """
    try:
        check(value)
    except Misfit as misfit:
        found = (place + misfit.place).removeprefix(".") or "the file"
        raise misplaced(found, misfit.expected, described(misfit.value)) from None


def misplaced(place: str, expected: str, got: object) -> SceneError:
    """The error of a file in which something at a JSON path is not what was expected."""
    return SceneError(f"cannot be read: {place}: expected {expected}, got {got}")


def described(value: Any) -> str:
    """A value in a few words."""
    if value is _ABSENT:
        return "none"
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, int) and abs(value) > GREATEST:
        return "a greater number"
    text = repr(value)
    return text if len(text) <= _SHOWN_MAX else f"{text[:_SHOWN_MAX]}…"


def record(required: Mapping[str, Check] | None = None, /, **optional: Check) -> Check:
    """An object with these parts; others are ignored."""
    needed = required or {}
    parts = {**needed, **optional}

    def check(value: Any) -> None:
        if not isinstance(value, dict):
            raise Misfit("an object", value)
        for name in needed:
            if name not in value:
                raise Misfit("a value", _ABSENT, f".{name}")
        for name in value.keys() & parts.keys():
            try:
                parts[name](value[name])
            except Misfit as misfit:
                raise misfit.within(f".{name}") from None

    return check


def named(item: Check) -> Check:
    """An object of equal parts with arbitrary names."""

    def check(value: Any) -> None:
        record(**dict.fromkeys(value, item))(value) if isinstance(value, dict) else record()(value)

    return check


def items(item: Check, count: int | None = None, expected: str = "a list") -> Check:
    """A list, of one length if ``count`` is given."""

    def check(value: Any) -> None:
        if not isinstance(value, list) or (count is not None and len(value) != count):
            raise Misfit(expected, value)
        for number, one in enumerate(value):
            try:
                item(one)
            except Misfit as misfit:
                raise misfit.within(f"[{number}]") from None

    return check


def numbers(count: int) -> Check:
    """A list of this many finite numbers."""
    return items(number, count, f"a list of {count} numbers")


def number(value: Any) -> None:
    """A finite number that single precision holds."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Misfit("a number", value)
    if not (math.isfinite(value) if isinstance(value, float) else True) or abs(value) > GREATEST:
        raise Misfit(f"a number from {-GREATEST:.3g} to {GREATEST:.3g}", value)


def whole(least: int = 0, most: int = (1 << 53)) -> Check:
    """A whole number in a range."""

    def check(value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            shown = f"from {least} to {most}" if most < 1 << 53 else f"of at least {least}"
            raise Misfit(f"a whole number {shown}", value)

    return check


def index(name: str, count: int) -> Check:
    """An index of a list of ``count`` objects."""

    def check(value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < count:
            raise Misfit(f"an index of {name} below {count}", value)

    return check


def one_of(*values: Any) -> Check:
    """One of some values of one type."""

    def check(value: Any) -> None:
        if type(value) is not type(values[0]) or value not in values:
            raise Misfit(f"one of {', '.join(map(str, values))}", value)

    return check


def text(value: Any) -> None:
    """A string that can be written in UTF-8, without the character zero."""
    if not isinstance(value, str):
        raise Misfit("a string", value)
    if "\0" in value or (not value.isascii() and any("\ud800" <= part <= "\udfff" for part in value)):
        raise Misfit("a string of printable characters", value)


def flag(value: Any) -> None:
    """True or false."""
    if not isinstance(value, bool):
        raise Misfit("true or false", value)
