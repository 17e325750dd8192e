"""The file that every command ends with: what it found, its options, and where they come from."""

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
    """What was found, with the options as ``config`` and where it comes from as ``provenance``.

    Args:
        found: entries of the summary.
        options: a record of options.
        added: what was used that is not the project's own.
        extra: further entries of the provenance, such as scene, seed and device.
    """
    config = dataclasses.asdict(options)
    return {**found, "config": config, "provenance": provenance(config, added, **extra)}


def write_summary(
    folder: Path, found: Mapping[str, Any], options: Any, added: Sequence[Brought] = (), **extra: Any
) -> dict[str, Any]:
    """Writes ``summary.json``; arguments and what is returned as of :func:`with_source`."""
    summary = with_source(found, options, added, **extra)
    write_json(folder / SUMMARY, summary)
    return summary
