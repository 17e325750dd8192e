"""Inputs of studies: the five of the dissertation, other scenes by their names, and files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tsar.config import require

if TYPE_CHECKING:
    from tsar.named import Named

INPUTS = ("corner-exit", "chase", "fly-by", "approach", "fast-crossing")
"""The five test inputs by number."""
ALL = "all inputs"
"""Stands for them together in tables."""


def is_file(input: str) -> bool:
    """Whether an input is a file rather than the name of a scene."""
    return input not in INPUTS and bool(Path(input).suffix)


def require_input(input: str, name: str = "input") -> None:
    """Checks that an input, which the option ``name`` holds, is the name of a scene, or a file that is there.

    Raises:
        ConfigError: it is neither.
    """
    if input in INPUTS:
        return
    if is_file(input):
        require(Path(input).is_file(), name, "a scene by its name, or a file that is there", input)
        return
    from scenes import catalog

    catalog.SCENES.require(input, name)


def is_added(input: str) -> bool:
    """Whether an input is a scene by name that is not the project's own."""
    if input in INPUTS or is_file(input):
        return False
    from scenes import catalog

    return not catalog.SCENES.is_own(input)


def tables_of(input: str) -> tuple[tuple[Named[Any], str], ...]:
    """The table of scenes with the name of an input; nothing for a file, and for a scene that was given as it is."""
    if input in INPUTS or is_file(input):
        return ()
    from scenes import catalog

    return ((catalog.SCENES, input),) if input in catalog.SCENES else ()


def phase_of(input: str, repetition: int, repetitions: int) -> float:
    """Phase of a repetition. Files, and scenes of the project other than the five inputs, have none."""
    return repetition / repetitions if input in INPUTS or is_added(input) else 0.0


def by_number(inputs: Iterable[str]) -> list[str]:
    """Each input once: the five by their numbers, then the others by name."""
    found = set(inputs)
    return [*(name for name in INPUTS if name in found), *sorted(found - set(INPUTS))]
