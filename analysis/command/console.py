"""Text and tables on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console
    from rich.table import Table as RichTable

_FILE_WIDTH = 150
"""Characters a line if the output is not a terminal."""


@dataclass(frozen=True)
class Table:
    """Rows of text under a header.

    Attributes:
        title, note: text above and below the table.
        header: names of the columns; empty for a table without a header.
        rows: one text for every column.
        words: how many columns, from the left, hold words; the others hold numbers and are aligned to the right.
        grouped: whether a line separates rows that differ in the first column.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    words: int = 1
    grouped: bool = False


def console(width: int | None = None) -> Console:
    """Standard output. Text appears unchanged: a path may contain brackets or colons, which rich would read as markup.

    Args:
        width: characters a line; by default those of the terminal, or 150 where the output is a file.
    """
    from rich.console import Console

    shown = Console(width=width, markup=False, emoji=False)
    if width is None and not shown.is_terminal:
        shown.width = _FILE_WIDTH
    return shown


def show(*parts: Table | str) -> None:
    """Prints tables that have rows and lines of text, in order."""
    shown = console()
    for part in parts:
        if isinstance(part, str):
            shown.print(part, soft_wrap=True)
        elif part.rows:
            shown.print(laid_out(part))


def written_to(out: Path, files: str) -> list[str]:
    """The last lines of a command: its files, and where to look at their page if they have one.

    Args:
        out: folder of the files.
        files: their names, separated by commas.
    """
    page = (out / "report.html").resolve().as_uri()
    return [f"written to {out}: {files}", *([f"look at it: {page}"] if "report.html" in files else [])]


def laid_out(table: Table) -> RichTable:
    """A table for rich."""
    from rich.table import Table as RichTable

    found = RichTable(
        title=table.title or None,
        caption=table.note or None,
        show_header=any(table.header),
        title_justify="left",
        caption_justify="left",
    )
    for number, name in enumerate(table.header):
        found.add_column(name, justify="left" if number < table.words else "right")
    for number, row in enumerate(table.rows):
        if table.grouped and number and row[0] != table.rows[number - 1][0]:
            found.add_section()
        found.add_row(*row)
    return found


def markdown(tables: Sequence[Table]) -> str:
    """Tables that have rows as Markdown, each under its title."""
    parts = []
    for table in tables:
        if not table.rows:
            continue
        lines = [table.header, ["---"] * len(table.header), *table.rows]
        parts.append("\n".join([f"{table.title}:", "", *("| " + " | ".join(line) + " |" for line in lines)]))
    return "\n\n".join(parts) + "\n"


def frame_table(rows: pd.DataFrame, title: str = "", digits: str = ".4g") -> Table:
    """A data frame as a table; NaN becomes a dash.

    Args:
        rows: the data frame, one row of the table for each of its rows.
        title: text above the table.
        digits: format of numbers that are not integers.
    """
    kinds = [str(kind) for kind in rows.dtypes]
    words = next((number for number, kind in enumerate(kinds) if kind[:3] in ("int", "flo")), len(kinds))
    body = [[_cell(value, digits) for value in row] for row in rows.itertuples(index=False)]
    return Table(title, [str(name) for name in rows.columns], body, words=words)


def _cell(value: object, digits: str) -> str:
    if isinstance(value, float):
        return "—" if value != value else f"{value:{digits}}"
    return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)
