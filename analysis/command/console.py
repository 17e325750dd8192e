"""Text and tables on the terminal."""

from __future__ import annotations

import pandas as pd
from rich.console import Console
from rich.table import Table

_WIDTH = 150
"""Characters a line of a data frame at least."""


def console(width: int | None = None) -> Console:
    """Standard output. Text appears as it is: a path may hold brackets or colons, which rich would take for markup.

    Args:
        width: characters a line; by default those of the terminal.
    """
    return Console(width=width, markup=False, emoji=False)


def frame_table(rows: pd.DataFrame, title: str = "") -> None:
    """Prints a data frame; numbers with four digits."""
    table = Table(title=title or None)
    for name in rows.columns:
        table.add_column(str(name), justify="right" if pd.api.types.is_numeric_dtype(rows[name]) else "left")
    for row in rows.itertuples(index=False):
        table.add_row(*(_short(value) for value in row))
    console(max(_WIDTH, console().width)).print(table)


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else str(value)
