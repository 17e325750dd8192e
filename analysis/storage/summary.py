"""The file that every command writes last: its results, its options, and their provenance."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from analysis.storage.files import write_json
from analysis.storage.provenance import provenance
from analysis.storage.results import SUMMARY
from analysis.storage.source import Brought


def with_source(found: Mapping[str, Any], options: Any, added: Sequence[Brought] = (), **extra: Any) -> dict[str, Any]:
    """The results, with the options as ``config`` and the provenance as ``provenance``.

    Args:
        found: entries of the summary.
        options: a record of options.
        added: additions of other packages that were used.
        extra: further entries of the provenance, such as scene, seed and device.
    """
    config = dataclasses.asdict(options)
    return {**found, "config": config, "provenance": provenance(config, added, **extra)}


def write_summary(
    folder: Path, found: Mapping[str, Any], options: Any, added: Sequence[Brought] = (), **extra: Any
) -> dict[str, Any]:
    """Writes ``summary.json``; arguments and return value as in :func:`with_source`."""
    summary = with_source(found, options, added, **extra)
    write_json(folder / SUMMARY, summary)
    return summary
