"""Kills a small command at random moments and lets it continue; runs as a separate process, because it forks.

``python -m tests.killed KIND FOLDER KILLS SEED`` makes everything unbroken in ``FOLDER/whole``, and in ``FOLDER/0`` and
so on kills the command just before an operation on files, twice in each, and then lets it end. Prints the kills and the
exit statuses as JSON.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
import sys
from pathlib import Path

import numpy as np

from tests.durable import KINDS

_OPERATIONS = {"open", "os.rename", "os.remove", "os.mkdir", "os.truncate", "sqlite3.connect"}


def forked(name: str, folder: Path, kill_at: int | None) -> int:
    """Makes a kind in a process that is killed at an operation on files of the folder; its wait status.

    The number of operations is in ``FOLDER.count`` afterwards, unless the process was killed.
    """
    pid = os.fork()
    if pid:
        return os.waitpid(pid, 0)[1]
    count, counter = 0, folder.with_suffix(".count")
    log = os.open(folder.with_suffix(".log"), os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(log, 1)
    os.dup2(log, 2)

    def counted(event: str, arguments: tuple) -> None:
        nonlocal count
        if event in _OPERATIONS and str(arguments[0]).startswith(f"{folder}/"):
            count += 1
            if count == kill_at:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(counted)
    status = 1
    try:
        status = KINDS[name].make(folder)
        counter.write_text(str(count))
    except BaseException as error:
        print(repr(error), file=sys.stderr)
    finally:
        os._exit(status)


def main(name: str, root: Path, kills: int, seed: int) -> None:
    """Makes, kills, goes on."""
    # imported once, before anything runs that starts threads: a fork has none of them
    for module in (
        "analysis.study.evaluation",
        "analysis.tracer.jobs",
        "analysis.perception.stimuli",
        "analysis.perception.protocol",
    ):
        importlib.import_module(module)
    heavy = "analysis.tracer.tiles", "analysis.page.video", "renderer.frames", "renderer.trace", "scenes.catalog"
    for module in heavy:
        importlib.import_module(module)

    def fresh(folder: Path) -> Path:
        folder.mkdir()
        KINDS[name].prepare(folder)
        return folder

    statuses, killed, rng = [forked(name, fresh(root / "whole"), None)], 0, np.random.default_rng(seed)
    operations = int((root / "whole.count").read_text())
    for number in range((kills + 1) // 2):
        folder = fresh(root / f"{number}")
        for _ in range(2):
            kill_at = int(rng.integers(1, operations + 1))
            while (status := forked(name, folder, kill_at)) == 0 and kill_at > 1:
                kill_at //= 2  # less was left to do
            killed += os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL
        statuses.append(forked(name, folder, None))
    print(json.dumps({"kills": killed, "operations": operations, "statuses": statuses}))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
