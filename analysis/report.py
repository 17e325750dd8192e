"""A record as one HTML file that needs nothing else: figures are embedded, everything from outside is escaped."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from PIL import Image

from analysis.files import atomic
from analysis.pictures import Pixels

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:1180px;margin:2em auto;padding:0 1em;color:#222}
h1{font-size:1.6em;margin-bottom:.2em} h2{font-size:1.15em;margin-top:2em;border-bottom:1px solid #ddd}
table{border-collapse:collapse;margin:.6em 0} td,th{padding:.2em .9em .2em 0;text-align:left;vertical-align:top}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums} tr{border-bottom:1px solid #eee}
img{max-width:100%} .strip{display:grid;grid-template-columns:4.5em repeat(6,1fr);gap:4px;font-size:12px}
.strip img{width:100%;display:block} .note{color:#555} code{font-size:.92em}
"""


@dataclass(frozen=True)
class Moment:
    """Pictures of one time by label."""

    time_s: float
    pictures: Mapping[str, Pixels]


@dataclass(frozen=True)
class Table:
    """Rows of text under a header; columns from the second on are numbers."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


@dataclass(frozen=True)
class Report:
    """Content of a report.

    Attributes:
        title: of the page.
        lead: paragraphs that say what was compared and what came out.
        key_numbers: table before the figures.
        figures: caption and PNG bytes; the moments stand after the first.
        moments: strip of pictures.
        tables: in order, after the figures.
        details: nested mappings shown as lists of names and values (configuration, provenance).
    """

    title: str
    lead: Sequence[str]
    key_numbers: Table
    figures: Sequence[tuple[str, bytes]] = ()
    moments: Sequence[Moment] = ()
    tables: Sequence[Table] = ()
    details: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


def write_report(path: Path, report: Report) -> None:
    """Writes the page atomically."""
    text = render(report)
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def render(report: Report) -> str:
    """The page as text."""
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>",
        f"<title>{escape(report.title)}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{escape(report.title)}</h1>",
        *(f"<p>{escape(paragraph)}</p>" for paragraph in report.lead),
        _table(report.key_numbers),
        *(_figure(caption, png) for caption, png in report.figures[:1]),
        _strip(report.moments),
        *(_figure(caption, png) for caption, png in report.figures[1:]),
        *(_table(table) for table in report.tables),
        *(_details(title, values) for title, values in report.details.items()),
        "</body></html>\n",
    ]
    return "\n".join(parts)


def png_bytes(pixels: Pixels) -> bytes:
    """An array ``(h, w, 3)`` uint8 as PNG."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


def _image(png: bytes, label: str) -> str:
    return f"<img alt='{escape(label, quote=True)}' src='data:image/png;base64,{base64.b64encode(png).decode()}'>"


def _figure(caption: str, png: bytes) -> str:
    return f"<h2>{escape(caption)}</h2>{_image(png, caption)}"


def _strip(moments: Sequence[Moment]) -> str:
    if not moments:
        return ""
    cells = ["<span></span>", *(f"<b>{escape(label)}</b>" for label in moments[0].pictures)]
    for moment in moments:
        cells.append(f"<span>{moment.time_s:.3f} s</span>")
        cells += [_image(png_bytes(p), f"{label} at {moment.time_s:.3f} s") for label, p in moment.pictures.items()]
    return f"<h2>Moments</h2><div class='strip'>{''.join(cells)}</div>"


def _table(table: Table) -> str:
    def row(cells: Sequence[str], tag: str) -> str:
        kinds = ["" if number == 0 else " class='n'" for number in range(len(cells))]
        return "<tr>" + "".join(f"<{tag}{k}>{escape(c)}</{tag}>" for k, c in zip(kinds, cells, strict=True)) + "</tr>"

    note = f"<p class='note'>{escape(table.note)}</p>" if table.note else ""
    body = "".join(row(cells, "td") for cells in table.rows)
    return f"<h2>{escape(table.title)}</h2><table>{row(table.header, 'th')}{body}</table>{note}"


def _details(title: str, values: Mapping[str, Any]) -> str:
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td><code>{escape(str(value))}</code></td></tr>" for name, value in flat(values)
    )
    return f"<details><summary><b>{escape(title)}</b></summary><table>{rows}</table></details>"


def flat(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Nested mappings as a list of dotted names and values."""
    rows: list[tuple[str, Any]] = []
    for name, value in values.items():
        rows += flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else [(f"{prefix}{name}", value)]
    return rows
