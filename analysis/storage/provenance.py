"""Provenance of a result: commit, configuration, versions, machine, and additions of other packages."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import os
import platform
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from analysis.command.extras import DISTRIBUTION
from analysis.storage.files import plain
from analysis.storage.source import Brought

_ROOT = Path(__file__).resolve().parents[2]
_CPU_INFO = Path("/proc/cpuinfo")
_WHERE = ("out", "references")
"""Fields of a configuration that say where results are written, and do not affect results."""


def provenance(config: Any, added: Sequence[Brought] = (), **extra: Any) -> dict[str, Any]:
    """The provenance of a run.

    Args:
        config: resolved configuration; its hash identifies the run, and leaves out where results are written.
        added: additions of other packages that the run used.
        extra: further entries, such as scene, seed and device.

    Returns:
        The entries by name. ``commit`` and ``uncommitted_changes`` are None outside a checkout and without git.
    """
    kept = {name: value for name, value in plain(config).items() if name not in _WHERE}
    versions: dict[str, str | None] = {}
    for package in (DISTRIBUTION, "torch", "warp-lang", "numpy"):
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = None
    commit, changes = _git("rev-parse", "HEAD"), _git("status", "--porcelain", "--untracked-files=no")
    return {
        "commit": commit,
        "uncommitted_changes": None if changes is None else bool(changes),
        "config_hash": hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()[:16],
        "added": list(added),
        "versions": {"python": platform.python_version(), **versions},
        "platform": platform.platform(),
        "processor": cpu_model(),
        "cpu_count": os.cpu_count(),
        **extra,
    }


def cpu_model() -> str:
    """Name of the processor as the operating system reports it."""
    try:
        with _CPU_INFO.open(encoding="utf-8") as lines:
            for line in lines:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _git(*arguments: str) -> str | None:
    """Output of a git command; None outside a checkout of the project, or if git fails."""
    if not (_ROOT / ".git").exists():  # a checkout of another project may lie above an installed package
        return None
    try:
        done = subprocess.run(["git", "-C", str(_ROOT), *arguments], capture_output=True, encoding="utf-8", timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
