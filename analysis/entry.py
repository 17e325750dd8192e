"""The command ``tsar``: every script of the project as a subcommand, and lists of all names.

Usage: tsar COMMAND [OPTIONS]; tsar COMMAND --help; tsar list [TABLE]; tsar --version
"""

from __future__ import annotations

import difflib
import importlib
import importlib.metadata
import sys

from analysis.command.cli import InputError, run_process
from analysis.command.extras import DISTRIBUTION
from analysis.command.later import command

COMMANDS = {
    "run": "analysis.comparison.run_command",
    "inputs": "analysis.comparison.inputs_command",
    "report": "analysis.comparison.report_command",
    "render": "analysis.tracer.render_command",
    "study": "analysis.suitability.command",
    "ablation": "analysis.ablation.command",
    "trade": "analysis.trade.command",
    "precision": "analysis.precision.command",
    "workloads": "analysis.workloads.command",
    "sensitivity": "analysis.sensitivity.command",
    "spectrum": "analysis.spectrum.command",
    "cost_report": "analysis.cost_report.command",
    "gallery": "analysis.tracer.gallery_command",
    "job": "analysis.tracer.job_command",
    "tiles": "analysis.tracer.tiles_command",
    "pointsets": "analysis.tracer.pointsets_command",
    "accelerators": "analysis.tracer.accelerators_command",
    "perception": "analysis.perception.command",
    "convert": "analysis.conversion.convert_command",
    "conversion_check": "analysis.conversion.check_command",
    "live": "analysis.live.command",
    "bench": "analysis.bench.command",
    "same": "analysis.storage.command",
}
"""Modules whose ``main`` runs a command. A script of the same name calls it too; the script of study is suitability."""

TABLES = {
    "policies": "tsar.policies:POLICIES",
    "metrics": "analysis.metrics:METRICS",
    "scenes": "scenes.catalog:SCENES",
    "formats": "scenes.formats:FORMATS",
    "point-sets": "renderer.sampling:POINT_SETS",
    "solvers": "tsar.choices:SOLVERS",
    "norms": "tsar.choices:NORMS",
    "reconstructions": "tsar.choices:RECONSTRUCTIONS",
}
"""Tables of names, by kind, with the place of each in the code."""


def main() -> None:
    """Runs the command that the command line names, and ends the process."""
    run_process(_dispatch)


def _dispatch() -> None:
    name, rest = (sys.argv[1:2] or ["--help"])[0], sys.argv[2:]
    helps = {"-h", "--help"}
    if name in helps or (name == "list" and not helps.isdisjoint(rest)):
        print(f"{__doc__}\nCommands: {', '.join([*COMMANDS, 'list'])}\nTables: {', '.join(TABLES)}")
    elif name == "--version":
        print(f"{DISTRIBUTION} {importlib.metadata.version(DISTRIBUTION)}")
    elif name == "list":
        for table in rest or TABLES:
            _print_table(table)
    else:
        called = command(_known(name, {**COMMANDS, "list": ""}, "command"))
        sys.argv = [f"tsar {name}", *rest]
        called()


def _print_table(name: str) -> None:
    """Prints the names in a table, and the module of each."""
    module, _, attribute = _known(name, TABLES, "list").partition(":")
    table = getattr(importlib.import_module(module), attribute)
    print(f"{name} (entry points: {table.group})")
    for entry in table:
        origin = table.origin(entry)
        added = "" if table.is_own(entry) else f" ({origin.distribution or 'no distribution'} {origin.version or ''})"
        print(f"  {entry:20} {origin.module}{added}")


def _known(name: str, known: dict[str, str], what: str) -> str:
    if name in known:
        return known[name]
    near = difflib.get_close_matches(name, known, n=1)
    hint = f" (nearest: {near[0]})" if near else ""
    raise InputError(f"{what}: expected one of {', '.join(known)}, got {name!r}{hint}")


if __name__ == "__main__":
    main()
