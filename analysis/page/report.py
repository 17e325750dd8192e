"""A report as one self-contained HTML file: figures and pictures are embedded, and all text is escaped."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from analysis.command.console import Table
from analysis.page import comparer as compared
from analysis.page import explorer as explored
from analysis.page.comparer import Comparer, block, source
from analysis.page.curves import drawing, letters_of
from analysis.page.environment import environment
from analysis.page.explorer import Explorer
from analysis.storage.files import write_text

STYLE = Path(__file__).with_name("report.css")


@dataclass(frozen=True)
class Report:
    """Content of a report.

    Attributes:
        title: title of the page.
        lead: one sentence with the outcome, and then paragraphs on the comparison.
        key_numbers: table before the figures; None for none.
        figures: caption and PNG bytes.
        comparer: pictures at many times and curves, before everything else; None for a page without one.
        tables: tables after the figures, in order. Those without rows are left out.
        details: nested mappings that are shown as lists of names and values (configuration, provenance).
        explorer: points with settings and pictures, before everything else; None for a page without one.
    """

    title: str
    lead: Sequence[str]
    key_numbers: Table | None
    figures: Sequence[tuple[str, bytes]] = ()
    comparer: Comparer | None = None
    tables: Sequence[Table] = ()
    details: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    explorer: Explorer | None = None


def write_report(path: Path, report: Report) -> None:
    """Writes the page atomically."""
    write_text(path, render(report))


def render(report: Report) -> str:
    """The page as text."""
    scripts = [*(compared.SCRIPTS if report.comparer else ()), *([explored.SCRIPT] if report.explorer else [])]
    script = "\n".join(one.read_text(encoding="utf-8") for one in scripts)
    style = STYLE.read_text(encoding="utf-8") + (explored.STYLE if report.explorer else "")
    shown: dict[str, Any] = {"given": None, "pictures": [], "drawings": []}
    if report.comparer:
        shown["given"], shown["pictures"] = report.comparer.stored()
        plots, span_s = report.comparer.plots, report.comparer.span_s
        shown["drawings"] = [(plot, drawing(plot, span_s, letters_of(plots))) for plot in plots]
    if report.explorer:
        shown |= explored.shown(report.explorer)
    return (
        environment()
        .get_template("report.html.j2")
        .render(report=report, policy=_policy(script), script=script, style=_safe(style), source=source, flat=flat,
                block=block, **shown)
        .lstrip()
    )  # fmt: skip


def _safe(style: str) -> Any:
    from markupsafe import Markup

    return Markup(style)  # styles come from this package alone


def _policy(script: str) -> str:
    """Content security policy of the page: nothing may be loaded, and only the script of the page may run."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    run = f"'sha256-{digest}'" if script else "'none'"
    return f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {run}; base-uri 'none'"


def flat(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Nested mappings as a list of dotted names and values."""
    rows: list[tuple[str, Any]] = []
    for name, value in values.items():
        rows += flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else [(f"{prefix}{name}", value)]
    return rows
