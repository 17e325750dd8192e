"""The benchmark as a table, and two of them compared."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from analysis.bench.turns import SPREAD
from analysis.command import console as tables
from analysis.storage.store import read_json

_WIDTH = 150
"""Characters a line where the output is not a terminal."""

_ROW = {"group": str, "name": str, "unit": str, "ours": float | None, "less_is_better": bool}
"""What a row of a stored benchmark must hold to be compared."""
_MET = {True: "yes", False: "NO", None: ""}


def console() -> Console:
    """Standard output, wide enough for a row where it goes into a file."""
    shown = tables.console()
    return shown if shown.is_terminal else tables.console(_WIDTH)


def figure(value: float | None) -> str:
    """A number with four significant digits; nothing where there is none."""
    if value is None:
        return ""
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def rows_table(found: Mapping[str, Any]) -> Table:
    """All rows of a ``bench.json``; notes are told apart by number.

    Args:
        found: its content.
    """
    table = Table(title=_title(found), title_justify="left", caption=_caption(found), caption_justify="left")
    for name in ("group", "name", "unit", "ours", "peer", "ratio", "spread", "target", "met"):
        table.add_column(name, justify="left" if name in ("group", "name", "unit") else "right")
    last = ""
    for row in found["rows"]:
        if last not in ("", row["group"]):
            table.add_section()
        last = row["group"]
        spread = row["spread"]
        peer = " ".join(part for part in (figure(row["peer"]), row["peer_name"]) if part)
        table.add_row(
            row["group"],
            row["name"],
            row["unit"],
            figure(row["ours"]),
            peer,
            figure(row["ratio"]),
            f"{figure(spread[0])} – {figure(spread[1])}" if spread else "",
            figure(row["target"]),
            _MET[row["met"]],
        )
    return table


def _title(found: Mapping[str, Any]) -> str:
    machine = found["machine"]
    gpu = f", {machine['gpu']}" if "gpu" in machine else ""
    versions = ", ".join(f"{name} {version or 'not installed'}" for name, version in found["versions"].items())
    size = f"{machine['cores']} cores, {machine['memory_gib']} GiB{gpu}"
    return f"{machine['cpu']}, {size}, load average before {machine['load_average']:.2f}\n{versions}"


def _caption(found: Mapping[str, Any]) -> str:
    notes = [f"{row['name']}: {row['note']}" for row in found["rows"] if row["note"]]
    return "\n".join([f"ratio above 1: ours is faster, or within its limit; spread: {SPREAD}", *notes])


def read_rows(path: Path) -> dict[tuple[str, str], Mapping[str, Any]]:
    """Rows of a ``bench.json`` by group and name.

    Raises:
        ValueError: it cannot be read, or holds none.
    """
    try:
        rows = read_json(path, {"rows": [_ROW]})["rows"]
    except OSError as error:
        raise ValueError(f"compare: cannot read {str(path)!r} ({error.strerror or error})") from None
    except ValueError as error:
        raise ValueError(f"compare: {error}") from None
    return {(row["group"], row["name"]): row for row in rows}


def comparison_table(first: Path, second: Path) -> Table:
    """Our figures of two benchmarks, row by row.

    Args:
        first, second: files; a ratio above 1 means that the second is better.

    Raises:
        ValueError: a file cannot be read, or the two share no row.
    """
    before, after = read_rows(first), read_rows(second)
    shared = [key for key in before if key in after]
    if not shared:
        raise ValueError(f"compare: {str(first)!r} and {str(second)!r} share no row")
    table = Table(title=f"{first} against {second}", title_justify="left")
    for name in ("group", "name", "unit", "first", "second", "ratio"):
        table.add_column(name, justify="left" if name in ("group", "name", "unit") else "right")
    for key in shared:
        a, b = before[key], after[key]
        table.add_row(*key, a["unit"], figure(a["ours"]), figure(b["ours"]), figure(better_by(a, b)))
    return table


def better_by(before: Mapping[str, Any], after: Mapping[str, Any]) -> float | None:
    """How many times better our figure became; None where one of the two is not positive."""
    a, b = before["ours"], after["ours"]
    if not (a and b and a > 0.0 and b > 0.0):
        return None
    return a / b if before["less_is_better"] else b / a
