"""Convert a scene file of one renderer to that of another, and report what could not be carried over.

Examples: python scripts/convert.py scene.pbrt out/scene.lxs
          python scripts/convert.py scene.lxs out/scene.pbrt --strict --report losses.json
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.conversion.options import ConvertOptions


def main() -> None:
    """Parses, converts, and prints the losses."""
    options = parse(ConvertOptions, __doc__ or "")
    from analysis.command.console import show
    from analysis.conversion.run import convert

    found = convert(options)
    counts = f"{found['instances']} shapes, {found['lights']} lights, {found['count']} losses"
    show(*found["lines"], f"{counts}; {options.target}")
