"""Tell whether two folders of results are the same: every number, table and picture, except measured seconds.

Example: python scripts/same.py out/before out/after
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from analysis.command.cli import bad_input, parse
from analysis.storage.sameness import compare_folders

EXIT_DIFFERENT = 1


@dataclass(frozen=True)
class SameOptions:
    """Two folders that the same command wrote."""

    first: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FIRST")]
    """Folder of results."""
    second: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SECOND")]
    """Folder of results."""
    ignore: tuple[str, ...] = ()
    """Names of files, entries of JSON files and columns to leave out."""


def main() -> None:
    """Compares, prints every difference, and ends with status 1 if there is one."""
    options = parse(SameOptions, __doc__ or "")
    with bad_input():
        difference = compare_folders(options.first, options.second, options.ignore)
    for line in difference.found:
        print(line)
    print(f"{difference.compared} files compared, {len(difference.found)} differences, "
          f"{len(difference.left_out)} files with measured seconds left out")  # fmt: skip
    if difference.found:
        sys.exit(EXIT_DIFFERENT)
