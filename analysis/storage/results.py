"""Folders for the results of commands: one process at a time writes, and no file of the user is replaced."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from fnmatch import fnmatch
from pathlib import Path

from analysis.command.ownership import own_folder
from analysis.storage.files import PARTIAL
from analysis.storage.journal import Journal
from analysis.storage.store import JOURNAL, Store

SUMMARY = "summary.json"
"""The file that a command writes last."""


def own_results(folder: Path, names: Iterable[str]) -> None:
    """Creates a folder for the results of a command, locks it for this process, and reserves names for commands.

    Args:
        folder: the folder that the user named as ``out``.
        names: names of all files that the command may write, replace or delete there, relative to the folder and with
            forward slashes; each may be a pattern. A reserved name belongs to commands from then on, so that files of
            a killed command may be replaced. Files that a :class:`~analysis.storage.store.Store` makes need not be
            named, nor the SVG beside each PNG of a figure.

    Raises:
        ValueError: the folder cannot be created or written, another process writes there, or one of the names belongs
            to a file that no command made.
    """
    own_folder(folder, "out")
    names = tuple(names)
    journal = Journal(folder / JOURNAL)
    taken = {name for row in journal.rows() for name in row.get("taken", ())}
    wanted = sorted({SUMMARY, *names, *(f"{name[:-4]}.svg" for name in names if name.endswith(".png"))} - taken)
    if not wanted:
        return
    if not _is_summary(folder / SUMMARY):
        foreign = sorted(_foreign(folder, wanted, taken))
        if foreign:
            more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
            raise ValueError(f"out: expected no file that this command did not make, found {foreign[0]}{more}; move it")
    journal.append({"taken": wanted})


@contextmanager
def reserved(folder: Path, names: Iterable[str]) -> Iterator[None]:
    """As :func:`own_results`, for a command that reads its input afterwards: where the block refuses the input before
    it has written anything into a new folder, no name stays reserved there."""
    fresh = not (folder / JOURNAL).exists()
    own_results(folder, names)
    before = set(folder.iterdir())
    try:
        yield
    except (OSError, ValueError):
        if fresh and set(folder.iterdir()) == before:
            (folder / JOURNAL).unlink()
        raise


def _foreign(folder: Path, wanted: Iterable[str], taken: set[str]) -> Iterator[Path]:
    """Files with one of the wanted names that no command made."""
    listed = Store(folder, "").listed()
    for pattern in wanted:
        for file in folder.glob(pattern):
            name = file.relative_to(folder).as_posix()
            known = name in listed or any(fnmatch(name, one) for one in taken)
            if not known and PARTIAL not in file.name:
                yield file


def _is_summary(file: Path) -> bool:
    """Whether a file is the summary of a command of a version that reserved no names."""
    try:
        found = json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(found, dict) and {"config", "provenance"} <= found.keys()
