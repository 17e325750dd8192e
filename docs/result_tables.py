"""Puts the tables that a study wrote into the page of its results, in place of those with the same columns.

Usage: python docs/result_tables.py PAGE FOLDER, such as docs/results/parts.md out/ablation
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from itertools import groupby
from pathlib import Path


def tables_of(text: str) -> dict[str, list[tuple[int, int]]]:
    """First and last line, exclusive, of the Markdown tables in a text, by their line of column names."""
    lines, found = text.splitlines(), defaultdict[str, list[tuple[int, int]]](list)
    for is_table, numbered in groupby(enumerate(lines), lambda pair: pair[1].startswith("|")):
        rows = list(numbered)
        if is_table and len(rows) > 1:
            names = " | ".join(cell.strip() for cell in rows[0][1].strip("|").split("|"))
            found[names].append((rows[0][0], rows[-1][0] + 1))
    return dict(found)


def replaced(page: str, written: str) -> tuple[str, list[str]]:
    """A page with the tables of another text in it.

    Args:
        page: whose tables have columns of their own, or the same ones as often as the other text has them.
        written: what the study wrote.

    Returns:
        The page, whose other lines stay as they are, and the column names of the tables that were replaced.

    Raises:
        ValueError: both have tables of the same columns, but not equally many.
    """
    old, new = tables_of(page), tables_of(written)
    common = [names for names in old if names in new]
    for names in common:
        if len(old[names]) != len(new[names]):
            raise ValueError(f"{names}: expected {len(new[names])} tables of these columns, got {len(old[names])}")
    lines, source = page.splitlines(), written.splitlines()
    pairs = [pair for names in common for pair in zip(old[names], new[names], strict=True)]
    for (first, end), (begin, stop) in sorted(pairs, reverse=True):  # from the last, so that numbers of lines hold
        lines[first:end] = source[begin:stop]
    return "\n".join(lines) + "\n", common


def main() -> None:
    """Rewrites the page, and says which tables were replaced."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("page", type=Path, help="page of results, such as docs/results/parts.md")
    parser.add_argument("folder", type=Path, help="folder of the study, such as out/ablation")
    asked = parser.parse_args()
    page, folder = asked.page, asked.folder
    text, common = replaced(page.read_text(encoding="utf-8"), (folder / "tables.md").read_text(encoding="utf-8"))
    page.write_text(text, encoding="utf-8")
    print(*(f"replaced: {names}" for names in common), f"{page}: date, revision and prose are yours to check", sep="\n")


if __name__ == "__main__":
    main()
