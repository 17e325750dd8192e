"""Kills small commands at random moments and lets them continue: ``python -m tests.killed --kills 50``.

Each kind of :mod:`tests.durable` runs in a process of its own, because it forks. It makes everything unbroken in
``OUT/KIND/whole`` and in ``OUT/KIND/again``. In ``OUT/KIND/0`` and so on it is killed twice and then ends: in turn just
before an operation on files, and after a random time. The results must be those of the unbroken one.
"""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from tests.durable import KINDS as COMMANDS
from tests.durable_studies import STUDIES

KINDS = {**COMMANDS, **STUDIES}
_OPERATIONS = {"open", "os.rename", "os.remove", "os.mkdir", "os.truncate", "sqlite3.connect"}


@dataclass(frozen=True)
class Options:
    """Options of the command line.

    Attributes:
        kinds: names out of :data:`KINDS`.
        kills: kills of each.
        seed: decides the moments.
        out: folder for what the commands make, which is removed, and for ``summary.json``.
    """

    kinds: tuple[str, ...] = tuple(KINDS)
    kills: int = 50
    seed: int = 0
    out: Path = Path("out/kills")


@dataclass(frozen=True)
class Kills:
    """What came of the kills of one kind.

    Attributes:
        kind: its name.
        kills: how many processes were killed.
        operations: operations on files of the unbroken command; an operation at which it is killed is one of these.
        seconds: wall seconds of the unbroken command.
        lost: commands that did not end with status 0 and all results, or left a traceback.
        wrong: commands that ended with status 0 and other results.
    """

    kind: str
    kills: int
    operations: int
    seconds: float
    lost: list[str]
    wrong: list[str]


def forked(name: str, folder: Path, kill_at: int | None = None, after_s: float | None = None) -> int:
    """Makes a kind in a process that may be killed, at an operation on files of the folder or after a time.

    The number of operations is in ``FOLDER.count`` afterwards, unless the process was killed.

    Returns:
        The wait status.
    """
    pid = os.fork()
    if pid:
        if after_s is not None:
            time.sleep(after_s)
            os.kill(pid, signal.SIGKILL)  # one that has ended waits to be asked for its status
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


def was_killed(status: int) -> bool:
    return os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL


def kill_kind(name: str, root: Path, kills: int, seed: int) -> Kills:
    """Makes, kills, goes on, compares."""
    heavy = (
        *("analysis.study.evaluation", "analysis.tracer.jobs", "analysis.perception.stimuli"),
        *("analysis.perception.protocol", "analysis.tracer.tiles", "analysis.page.video", "renderer.frames"),
        *("renderer.trace", "scenes.catalog"),
    )
    for module in heavy:  # imported once, before anything runs that starts threads: a fork has none of them
        importlib.import_module(module)

    def fresh(folder: Path) -> Path:
        folder.mkdir(parents=True)
        KINDS[name].prepare(folder)
        return folder

    statuses, killed, rng = {"whole": forked(name, fresh(root / "whole"))}, 0, np.random.default_rng(seed)
    began = time.monotonic()
    statuses["again"] = forked(name, fresh(root / "again"))  # once kernels are compiled
    seconds = time.monotonic() - began
    operations = int((root / "whole.count").read_text()) if statuses["whole"] == 0 else 0
    for number in range((kills + 1) // 2 if operations else 0):
        folder = fresh(root / f"{number}")
        for turn in range(min(2, kills - 2 * number)):
            at, after_s = int(rng.integers(1, operations + 1)), float(rng.uniform(0.0, seconds))
            while True:  # less may be left to do
                moment = {"kill_at": at} if at and (number + turn) % 2 else {"after_s": after_s}
                if was_killed(forked(name, folder, **moment)):
                    killed += 1
                    break
                at, after_s = at // 2, after_s / 2
        statuses[f"{number}"] = forked(name, folder)
    return Kills(name, killed, operations, round(seconds, 1), *compared(name, root, statuses))


def compared(name: str, root: Path, statuses: dict[str, int]) -> tuple[list[str], list[str]]:
    """What is lost and what is wrong, with reasons."""
    expected, lost, wrong = KINDS[name].result(root / "whole"), list[str](), list[str]()
    for folder, status in statuses.items():
        found = KINDS[name].result(root / folder)
        log = (root / folder).with_suffix(".log").read_text()
        if status or not found or found.keys() != expected.keys() or "Traceback" in log:
            lost.append(f"{folder}: status {status}, {len(found)} of {len(expected)} results; {log[-300:]}")
        elif differing := [one for one in expected if found[one] != expected[one]]:
            wrong.append(f"{folder}: {', '.join(differing)}")
    return lost, wrong


def main(options: Options) -> None:
    """One kind in this process, several in one each; the status of several is 1 if a result was lost or wrong."""
    unknown = [kind for kind in options.kinds if kind not in KINDS]
    if unknown or not options.kinds:
        raise SystemExit(f"kinds: expected some of {', '.join(KINDS)}, got {', '.join(unknown) or 'none'}")
    if len(options.kinds) == 1:
        folder = options.out.resolve() / options.kinds[0].replace(" ", "-")
        shutil.rmtree(folder, ignore_errors=True)
        found = kill_kind(options.kinds[0], folder, options.kills, options.seed)
        if not (found.lost or found.wrong):
            shutil.rmtree(folder)
        print(json.dumps(dataclasses.asdict(found)))
        return
    from analysis.storage.summary import write_summary

    rows = []
    for kind in options.kinds:
        own = ("--kinds", kind, "--kills", str(options.kills), "--seed", str(options.seed), "--out", str(options.out))
        done = subprocess.run(
            [sys.executable, "-m", "tests.killed", *own], stdout=subprocess.PIPE, text=True, check=True
        )
        rows.append(json.loads(done.stdout.splitlines()[-1]))
        counts = *(f"{len(rows[-1][one])} {one}" for one in ("lost", "wrong")), f"{rows[-1]['seconds']} s unbroken"
        print("{kind}: {kills} kills".format(**rows[-1]), *counts, sep=", ", flush=True)
        totals = {name: sum(len(row[name]) for row in rows) for name in ("lost", "wrong")}
        write_summary(options.out, {"kills": sum(row["kills"] for row in rows), **totals, "rows": rows}, options)
    print(f"{sum(row['kills'] for row in rows)} kills, {totals['lost']} lost, {totals['wrong']} silently wrong")
    raise SystemExit(bool(totals["lost"] or totals["wrong"]))


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
