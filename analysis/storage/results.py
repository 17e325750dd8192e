"""Folders that commands write results to: one process at a time, and nothing of the user's is replaced."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from fnmatch import fnmatch
from pathlib import Path

from analysis.command.ownership import own_folder
from analysis.storage.files import PARTIAL
from analysis.storage.journal import Journal
from analysis.storage.store import JOURNAL, Store

SUMMARY = "summary.json"
"""What a command writes last."""


def own_results(folder: Path, names: Iterable[str]) -> None:
    """Creates a folder for the results of a command and takes it for this process, and the names for commands.

    Args:
        folder: which the user named as ``out``.
        names: of all files that the command may write, replace or delete there, relative to the folder and with
            forward slashes; each may be a pattern. Names that a command took belong to commands from then on, so that
            what a killed one left behind may be replaced. Files that a :class:`~analysis.storage.store.Store` makes
            need not be named, nor the SVG that stands beside each PNG of a figure.

    Raises:
        ValueError: the folder cannot be created or written, another process writes there, or a file that no command
            made has one of the names.
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


def _foreign(folder: Path, wanted: Iterable[str], taken: set[str]) -> Iterator[Path]:
    """Files of the wanted names that no command made."""
    listed = Store(folder, "").listed()
    for pattern in wanted:
        for file in folder.glob(pattern):
            name = file.relative_to(folder).as_posix()
            known = name in listed or any(fnmatch(name, one) for one in taken)
            if not known and PARTIAL not in file.name:
                yield file


def _is_summary(file: Path) -> bool:
    """Whether a file is the summary of a command, of a version that took no names."""
    try:
        found = json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(found, dict) and {"config", "provenance"} <= found.keys()
