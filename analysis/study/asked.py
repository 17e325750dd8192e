"""Checks of the options that several studies have."""

from __future__ import annotations

from collections.abc import Sequence

from analysis.study.cases import ROWS
from analysis.study.inputs import INPUTS
from tsar.config import require
from tsar.named import Named


def require_distinct(options: object, *names: str) -> None:
    """Checks that each of the named fields holds something, and nothing twice.

    Raises:
        ConfigError: one does not.
    """
    for name in names:
        chosen = getattr(options, name)
        require(0 < len(chosen) == len(set(chosen)), name, "at least one, none twice", chosen)


def require_inputs(inputs: Sequence[str], field: str = "inputs", numbers: bool = False) -> None:
    """Checks that all are names of scenes; nothing is imported for the five inputs.

    Args:
        inputs: names.
        field: the option that holds them.
        numbers: whether the five inputs may be given by their numbers, too.

    Raises:
        ConfigError: one is not; the message has the known names and the nearest of them.
    """
    known = {*INPUTS, *(map(str, range(len(INPUTS))) if numbers else ())}
    if known.issuperset(inputs):
        return
    from scenes.catalog import SCENES

    for name in known.symmetric_difference(inputs) - known:
        SCENES.require(name, field)


def require_rows(name: str, rows: Sequence[int]) -> None:
    """Checks numbers of rows of table 7.2, which the option ``name`` holds.

    Raises:
        ConfigError: one is not the number of a row.
    """
    require(all(0 <= row < len(ROWS) for row in rows), name, f"numbers from 0 to {len(ROWS) - 1}", rows)


def require_named(options: object, **tables: Named) -> None:
    """Checks that each of the named fields holds names of its table.

    Raises:
        ConfigError: one does not; the message has the known names and the nearest of them.
    """
    for field, table in tables.items():
        for one in getattr(options, field):
            table.require(one, field)
