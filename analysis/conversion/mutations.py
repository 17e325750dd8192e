"""Scene files that are changed at random: each makes a scene or one clear line, within a bound of time and memory.

They are read in a process of their own, which is ended and counted if it hangs or dies. Finished batches are recorded,
so that an interrupted run goes on where it was.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import shutil
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from analysis.command.progress import Task
from analysis.storage.journal import Journal
from analysis.storage.source import code_hash
from analysis.study.memory import PeakMemory

LIMIT_S, LIMIT_MB = 5.0, 1024.0
"""Most seconds of processor time for a file, and most memory of the process that reads it."""

_STUCK_S = 60.0
_BATCH = 50
_WORDS = (b" nan ", b" 1e308 ", b" -1 ", b' "', b" [ ", b" ] ", b" 0 ", b"AttributeBegin ", b"AttributeEnd ",
          b" { ", b" } ", b"</World>", b"over ")  # fmt: skip
_NEWER = {"pbrt4": "-4.pbrt", "mitsuba3": "-3.xml", "gltf": ".gltf", "usd": ".usda"}


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """A file with some of it changed, cut, doubled or replaced by words of scene files."""
    found = bytearray(content)
    for _ in range(rng.integers(1, 4)):
        at, size = int(rng.integers(0, len(found) + 1)), int(rng.integers(1, 40))
        what = rng.integers(0, 5)
        if what == 0:
            found[at : at + size] = b""
        elif what == 1:
            found[at:at] = found[at : at + size]
        elif what == 2:
            found[at : at + 1] = bytes([int(rng.integers(0, 256))])
        elif what == 3:
            found[at:at] = _WORDS[rng.integers(0, len(_WORDS))]
        else:
            found[at:] = found[at:][: int(rng.integers(0, max(1, len(found) - at)))]
    return bytes(found)


def sources_in(folder: Path, scenes: tuple[Path, ...], root: Path | None) -> list[Path]:
    """Copies scenes with their folders into a folder, and writes each beside itself in the newest formats.

    Args:
        folder: an empty folder, which becomes the root of the copies.
        scenes: scene files.
        root: folder that they may read from; by default their own.
    """
    from scenes.formats.conversion import load_scene_file, save_scene_file

    made: list[Path] = []
    for number, scene in enumerate(scenes):
        around = (root or scene.parent).resolve()
        copy = folder / ("root" if root else f"{number:02d}")
        if not copy.exists():
            shutil.copytree(around, copy, copy_function=shutil.copyfile)
            for path in [copy, *(path for path in copy.rglob("*") if path.is_dir())]:
                path.chmod(0o755)
        file = copy / scene.resolve().relative_to(around)
        made.append(file)
        for to, ending in _NEWER.items():
            made.append(file.with_name(f"newer-{file.stem}{ending}"))
            save_scene_file(load_scene_file(file, folder), made[-1], to)
    made.append(folder / "newer.json")
    tree = {"type": "scene", "sensor": {"type": "perspective"}, "ball": {"type": "sphere", "radius": 2.0}}
    tree["floor"] = {"type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}}
    made[-1].write_text(json.dumps(tree), encoding="utf-8")
    return made


def outcome_of(file: Path, folder: Path) -> tuple[str, str]:
    """``scene``, ``line`` or ``traceback``, and the error; a message of several lines counts as a traceback."""
    from scenes.canonical import SceneError
    from scenes.formats.conversion import load_scene_file

    try:
        load_scene_file(file, folder)
    except SceneError as error:
        return ("line" if "\n" not in str(error) and len(str(error)) < 1000 else "traceback"), str(error)
    except Exception as error:  # counted, whatever it is
        return "traceback", f"{type(error).__name__}: {error}"
    return "scene", ""


def _read(pipe: Connection, sources: list[Path], folder: Path, seed: int) -> None:
    """Answers each number with what reading the changed file came to, seconds of processor time, and memory in MB."""
    contents = [file.read_bytes() for file in sources]
    while True:
        number = pipe.recv()
        rng = np.random.default_rng([seed, number])
        chosen = int(rng.integers(0, len(sources)))
        file = sources[chosen]
        changed = file.with_name(f"changed-{os.getpid()}{file.suffix}")
        changed.write_bytes(mutated(contents[chosen], rng))
        begun_s = time.process_time()
        with PeakMemory() as peak:
            outcome, error = outcome_of(changed, folder)
        spent_s = time.process_time() - begun_s
        changed.unlink()
        pipe.send((outcome, error, file.name, spent_s, peak.bytes / 2**20))


class _Reader:
    """A process that reads changed files."""

    def __init__(self, *given: Any) -> None:
        self.pipe, theirs = multiprocessing.Pipe()
        context = multiprocessing.get_context("spawn")
        self.process = context.Process(target=_read, args=(theirs, *given), daemon=True)
        self.process.start()
        theirs.close()

    def answer(self, number: int) -> tuple[str, str, str, float, float] | None:
        """What reading one file came to; None if the process hangs or dies, and is of no more use."""
        try:
            self.pipe.send(number)
            if self.pipe.poll(_STUCK_S):
                return self.pipe.recv()
        except (EOFError, OSError):
            pass
        self.end()
        return None

    def end(self) -> None:
        self.process.kill()
        self.process.join()


@dataclass
class Mutations:
    """Reads changed files in batches and counts what they came to. Batches that other code has read do not count.

    Attributes:
        sources: the files that are changed.
        folder: folder that they may read from.
        journal: file for the finished batches.
        seed: seed of the changes.
    """

    sources: list[Path]
    folder: Path
    journal: Path
    seed: int = 0

    def rows(self, count: int, task: Task) -> list[dict[str, Any]]:
        """A row for each batch of the first ``count`` changed files; those of an earlier run are not repeated."""
        from scenes.formats.conversion import load_scene_file

        digest = hashlib.blake2b(f"{self.seed} {code_hash(load_scene_file)}".encode(), digest_size=8)
        for file in self.sources:
            digest.update(file.name.encode() + file.read_bytes())
        key, journal = digest.hexdigest(), Journal(self.journal)
        done = {row["first"]: row for row in journal.rows() if row["key"] == key}
        reader, found = None, []
        for first in range(0, count, _BATCH):
            numbers = range(first, min(first + _BATCH, count))
            if first not in done or done[first]["files"] != len(numbers):
                reader = reader or self._reader()
                row, reader = self._batch(numbers, reader)
                done[first] = {"key": key, "first": first, **row}
                journal.append(done[first])
            found.append({name: value for name, value in done[first].items() if name != "key"})
            task.advance(len(numbers))
        if reader is not None:
            reader.end()
        return found

    def _reader(self) -> _Reader:
        return _Reader(self.sources, self.folder, self.seed)

    def _batch(self, numbers: range, reader: _Reader) -> tuple[dict[str, Any], _Reader]:
        row: dict[str, Any] = {"files": len(numbers), "scene": 0, "line": 0, "traceback": 0, "slow": 0, "large": 0,
                               "longest_s": 0.0, "most_mb": 0.0, "faults": []}  # fmt: skip
        for number in numbers:
            answer = reader.answer(number)
            if answer is None:
                row["slow"] += 1
                row["faults"].append(f"{number}: the process hung or died")
                reader = self._reader()
                continue
            outcome, error, name, spent_s, most_mb = answer
            row[outcome] += 1
            row["slow"] += spent_s > LIMIT_S
            row["large"] += most_mb > LIMIT_MB
            row["longest_s"], row["most_mb"] = max(row["longest_s"], spent_s), max(row["most_mb"], most_mb)
            if outcome == "traceback" or spent_s > LIMIT_S or most_mb > LIMIT_MB:
                row["faults"].append(f"{number}, {name}: {outcome} {error[:200]!r}, {spent_s:.2f} s, {most_mb:.0f} MB")
        return row, reader


def summed(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """The counts of all batches, and their greatest times and sizes."""
    total = {name: sum(row[name] for row in rows) for name in ("files", "scene", "line", "traceback", "slow", "large")}
    return {**total, **{name: max((row[name] for row in rows), default=0.0) for name in ("longest_s", "most_mb")}}
