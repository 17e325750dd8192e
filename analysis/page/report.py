"""A report as one self-contained HTML file: figures are embedded, and all text is escaped."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from analysis.command.console import Table
from analysis.page import explorer as explored
from analysis.page import player as played
from analysis.page.explorer import Explorer
from analysis.page.player import Player
from analysis.storage.files import atomic

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:1060px;margin:2em auto;padding:0 1em;color:#222;
overflow-wrap:break-word} h1{font-size:1.6em;margin-bottom:.2em;line-height:1.25}
h2{font-size:1.15em;margin-top:2em;border-bottom:1px solid #ddd}
table{border-collapse:collapse;margin:.6em 0} td,th{padding:.2em .9em .2em 0;text-align:left;vertical-align:top}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums} tr{border-bottom:1px solid #eee} .wide{overflow-x:auto}
img{max-width:100%} .note{color:#555} code{font-size:.92em;overflow-wrap:anywhere}
"""


@dataclass(frozen=True)
class Report:
    """Content of a report.

    Attributes:
        title: of the page.
        lead: paragraphs that say what was compared and what came out.
        key_numbers: table before the figures; None for none.
        figures: caption and PNG bytes.
        player: pictures behind a slider, before everything else; None for a page without one.
        tables: in order, after the figures.
        details: nested mappings shown as lists of names and values (configuration, provenance).
        explorer: points with settings and pictures, before everything else; None for a page without one.
    """

    title: str
    lead: Sequence[str]
    key_numbers: Table | None
    figures: Sequence[tuple[str, bytes]] = ()
    player: Player | None = None
    tables: Sequence[Table] = ()
    details: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    explorer: Explorer | None = None


def write_report(path: Path, report: Report) -> None:
    """Writes the page atomically."""
    text = render(report)
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def render(report: Report) -> str:
    """The page as text."""
    used = [played] if report.player else []
    used += [explored] if report.explorer else []
    script = "".join(one.SCRIPT.read_text(encoding="utf-8") for one in used)
    style = _STYLE + "".join(one.STYLE for one in used)
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>",
        "<meta name='viewport' content='width=device-width, initial-scale=1'>",
        f"<meta http-equiv='Content-Security-Policy' content=\"{_policy(script)}\">",
        f"<title>{escape(report.title)}</title><style>{style}</style></head>",
        f"<body><h1>{escape(report.title)}</h1>",
        *(f"<p>{escape(paragraph)}</p>" for paragraph in report.lead),
        played.markup(report.player) if report.player else "",
        explored.markup(report.explorer) if report.explorer else "",
        _table(report.key_numbers) if report.key_numbers else "",
        *(_figure(caption, png) for caption, png in report.figures),
        *(_table(table) for table in report.tables),
        *(_details(title, values) for title, values in report.details.items()),
        f"<script>{script}</script>" if script else "",
        "</body></html>\n",
    ]
    return "\n".join(parts)


def _policy(script: str) -> str:
    """Nothing may be loaded, and nothing run but the script of the page."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    run = f"'sha256-{digest}'" if script else "'none'"
    return f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {run}; base-uri 'none'"


def _figure(caption: str, png: bytes) -> str:
    label = escape(caption, quote=True)
    return f"<h2>{escape(caption)}</h2><img alt='{label}' src='{played.source(png)}'>"


def _table(table: Table) -> str:
    def row(cells: Sequence[str], tag: str) -> str:
        kinds = ["" if number < table.words else " class='n'" for number in range(len(cells))]
        return "<tr>" + "".join(f"<{tag}{k}>{escape(c)}</{tag}>" for k, c in zip(kinds, cells, strict=True)) + "</tr>"

    note = f"<p class='note'>{escape(table.note)}</p>" if table.note else ""
    body = "".join(row(cells, "td") for cells in table.rows)
    return f"<h2>{escape(table.title)}</h2><div class='wide'><table>{row(table.header, 'th')}{body}</table></div>{note}"


def _details(title: str, values: Mapping[str, Any]) -> str:
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td><code>{escape(str(value))}</code></td></tr>" for name, value in flat(values)
    )
    return f"<details><summary><b>{escape(title)}</b></summary><div class='wide'><table>{rows}</table></div></details>"


def flat(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Nested mappings as a list of dotted names and values."""
    rows: list[tuple[str, Any]] = []
    for name, value in values.items():
        rows += flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else [(f"{prefix}{name}", value)]
    return rows
