"""The benchmark as a table, and two of them compared."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from analysis.bench.rows import SPREAD
from analysis.command.console import Table
from analysis.storage.store import read_json

_ROW = {"group": str, "name": str, "unit": str, "ours": float | None, "less_is_better": bool}
"""Fields that a row of a stored benchmark must have to be compared."""
_MET = {True: "yes", False: "NO", None: ""}


def figure(value: float | None) -> str:
    """A number with four significant digits; nothing where there is none."""
    if value is None:
        return ""
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


_COLUMNS = ("unit", "ours", "peer", "ratio", "spread", "target", "met")


def rows_table(found: Mapping[str, Any]) -> Table:
    """All rows of a ``bench.json``, with numbered notes.

    Args:
        found: content of the file.
    """
    rows = [(row["group"], row["name"], *_figures(row)) for row in found["rows"]]
    return Table(_title(found), ("group", "name", *_COLUMNS), rows, _caption(found), words=3, grouped=True)


def group_tables(found: Mapping[str, Any]) -> list[Table]:
    """The rows of a ``bench.json``, a table a group, without notes.

    The first column has the name of the group, and of the instruction set if our side was limited to one.
    """
    isa = "" if found.get("isa", "native") == "native" else f", {found['isa']}"
    tables = []
    for group in dict.fromkeys(row["group"] for row in found["rows"]):
        rows = [(row["name"], *_figures(row)) for row in found["rows"] if row["group"] == group]
        tables.append(Table(f"{group}{isa}", (f"{group}{isa}", *_COLUMNS), rows))
    return tables


def _figures(row: Mapping[str, Any]) -> tuple[str, ...]:
    return (
        row["unit"],
        figure(row["ours"]),
        " ".join(part for part in (figure(row["peer"]), row["peer_name"]) if part),
        figure(row["ratio"]),
        " – ".join(figure(value) for value in row["spread"] or ()),
        figure(row["target"]),
        _MET[row["met"]],
    )


def _title(found: Mapping[str, Any]) -> str:
    machine = found["machine"]
    gpu = f", {machine['gpu']}" if "gpu" in machine else ""
    versions = ", ".join(f"{name} {version or 'not installed'}" for name, version in found["versions"].items())
    size = f"{machine['cores']} cores, {machine['memory_gib']} GiB{gpu}"
    isa = "" if found.get("isa", "native") == "native" else f", limited to {found['isa']}"
    return f"{machine['cpu']}, {size}{isa}, load average before {machine['load_average']:.2f}\n{versions}"


def _caption(found: Mapping[str, Any]) -> str:
    notes = [f"{row['name']}: {row['note']}" for row in found["rows"] if row["note"]]
    return "\n".join([f"ratio above 1: ours is faster, or within its limit; spread: {SPREAD}", *notes])


def read_rows(path: Path) -> dict[tuple[str, str], Mapping[str, Any]]:
    """Rows of a ``bench.json`` by group and name.

    Raises:
        ValueError: the file cannot be read, or holds no rows.
    """
    try:
        rows = read_json(path, {"rows": [_ROW]})["rows"]
    except OSError as error:
        raise ValueError(f"compare: cannot read {str(path)!r} ({error.strerror or error})") from None
    except ValueError as error:
        raise ValueError(f"compare: {error}") from None
    return {(row["group"], row["name"]): row for row in rows}


def comparison_table(first: Path, second: Path) -> Table:
    """Figures of our side in two benchmarks, row by row.

    Args:
        first, second: files; a ratio above 1 means that the second is better.

    Raises:
        ValueError: a file cannot be read, or the files share no row.
    """
    before, after = read_rows(first), read_rows(second)
    shared = [key for key in before if key in after]
    if not shared:
        raise ValueError(f"compare: {str(first)!r} and {str(second)!r} share no row")
    rows = []
    for key in shared:
        a, b = before[key], after[key]
        rows.append((*key, a["unit"], figure(a["ours"]), figure(b["ours"]), figure(better_by(a, b))))
    return Table(f"{first} against {second}", ("group", "name", "unit", "first", "second", "ratio"), rows, words=3)


def better_by(before: Mapping[str, Any], after: Mapping[str, Any]) -> float | None:
    """Factor by which our figure improved; None where one of the two is not positive."""
    a, b = before["ours"], after["ours"]
    if not (a and b and a > 0.0 and b > 0.0):
        return None
    return a / b if before["less_is_better"] else b / a
