"""Folders of finished runs: their names and summaries, read before anything else loads."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from analysis.storage.results import SUMMARY


def named_folders(folders: Sequence[Path]) -> dict[str, Path]:
    """Folders by the shortest ends of their paths that differ.

    Raises:
        ValueError: a folder is given twice.
    """
    parts = [folder.resolve().parts for folder in folders]
    for count in range(1, max(map(len, parts)) + 1):
        named = {"/".join(part[-count:]): folder for part, folder in zip(parts, folders, strict=True)}
        if len(named) == len(folders):
            return named
    raise ValueError(f"folders: expected a folder once, got {', '.join(map(str, folders))}")


def read_summary(folder: Path) -> dict[str, Any]:
    """The content of ``summary.json`` of a comparison.

    Raises:
        ValueError: it is missing, or that of another command.
    """
    try:
        summary = json.loads((folder / SUMMARY).read_bytes())
    except (OSError, ValueError, RecursionError):
        raise ValueError(f"{folder}: expected the folder of a finished run, found no {SUMMARY} to read") from None
    known = {"policy": str, "rivals": list, "mse": dict, "reference_time_s": list, "config": dict, "provenance": dict}
    given = summary if isinstance(summary, dict) else {}
    lacking = [key for key, kind in known.items() if not isinstance(given.get(key), kind)]
    if lacking:
        raise ValueError(f"{folder}: expected the {SUMMARY} of a comparison, found none of {', '.join(lacking)} in it")
    return summary
