"""A session of the study with a person: its trials, and answers that are on disk before they count."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.cli import InputError
from analysis.files import atomic, write_json
from analysis.perception.observers import COLUMNS
from analysis.perception.stimuli import read_manifest

HUMAN_TASK = "dual pair"
_SESSION, _ANSWERS, TABLE = "session.json", "answers.jsonl", "trials-human.parquet"


@dataclass(frozen=True)
class Trial:
    """One question: which of two pairs differs.

    Attributes:
        number: in the session, from 0.
        test, reference: numbers of stimuli of the manifest; the other pair is twice the reference.
        repetition: of the stimulus, from 0.
        side: ``left`` or ``right``, where the pair is that differs.
        test_first: whether the test is the upper of that pair.
    """

    number: int
    test: int
    reference: int
    repetition: int
    side: str
    test_first: bool


class Session:
    """The trials of one person, in a folder of their own; opened again it goes on where it was."""

    def __init__(self, folder: Path, stimuli: Path, observer: str, repetitions: int, seed: int) -> None:
        """Opens the session of a folder, or begins it.

        Args:
            folder: of the session.
            stimuli: folder of the stimuli.
            observer: name of the person; that of a session begun before must be the same.
            repetitions: of each stimulus.
            seed: of orders and sides.

        Raises:
            InputError: the folder holds a session of another person or other stimuli, or there is nothing to compare.
        """
        self.folder, self.stimuli = folder, stimuli
        self.manifest = read_manifest(stimuli)
        self.rows: list[dict[str, Any]] = self.manifest["stimuli"]
        hashes = [row["sha256"] for row in self.rows]
        identity = {"observer": observer, "repetitions": repetitions, "seed": seed, "sha256": hashes}
        self.observer = observer
        self.trials = _trials(self.rows, repetitions, seed)
        if not self.trials:
            raise InputError("stimuli: expected two levels of a scene, set and filter at least, got one")
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / _SESSION
        if not file.exists():
            write_json(file, identity)
        elif json.loads(file.read_text()) != identity:
            raise InputError(f"out: {file}: expected a session of {observer!r} with these stimuli, found another")
        self.answers: dict[int, dict[str, Any]] = {}
        for answer in _stored(folder / _ANSWERS):
            self.answers.setdefault(answer["trial"], answer)

    @property
    def current(self) -> Trial | None:
        """The first trial without an answer; None at the end."""
        return next((trial for trial in self.trials if trial.number not in self.answers), None)

    def answer(self, number: int, side: str, facts: dict[str, Any]) -> bool:
        """Stores an answer, durably, if the trial has none.

        Args:
            number: of the trial.
            side: that was named.
            facts: what the page measured: seconds to the answer, display rate, dropped frames, window.

        Returns:
            Whether it was stored; False where the trial was answered before.

        Raises:
            ValueError: there is no such trial, or its turn has not come, or the side is none.
        """
        if side not in ("left", "right"):
            raise ValueError(f"answer: expected left or right, got {side!r}")
        if number in self.answers:
            return False
        if self.current is None or number != self.current.number:
            raise ValueError(f"answer: expected trial {self.current and self.current.number}, got {number}")
        row = {"trial": number, "answer": side, **facts}
        with (self.folder / _ANSWERS).open("a") as file:
            file.write(json.dumps(row) + "\n")
            file.flush()
            os.fsync(file.fileno())
        self.answers[number] = row
        return True

    def table(self) -> pd.DataFrame:
        """The answered trials, with the columns of simulated ones and what the page measured."""
        rows = []
        for trial in self.trials:
            if trial.number not in self.answers:
                continue
            stimulus, answer = self.rows[trial.test], self.answers[trial.number]
            rows.append(
                {
                    **{name: stimulus[name] for name in ("scene", "point_set", "time_filter", "samples")},
                    "observer": self.observer,
                    "observer_kind": "human",
                    "task": HUMAN_TASK,
                    "session": 0,
                    "trial": trial.number,
                    "repetition": trial.repetition,
                    "differing_side": trial.side,
                    "answer": answer["answer"],
                    "correct": answer["answer"] == trial.side,
                    "response_s": answer.get("response_s", np.nan),
                    "display_rate_hz": answer.get("display_rate_hz", np.nan),
                    "dropped_frames": answer.get("dropped_frames", -1),
                    "fits_window": answer.get("fits_window", False),
                }
            )
        extra = ["display_rate_hz", "dropped_frames", "fits_window"]
        return pd.DataFrame(rows, columns=[*COLUMNS, *extra])

    def export(self) -> Path:
        """Writes the table; where it is."""
        with atomic(self.folder / TABLE) as path:
            self.table().to_parquet(path, index=False)
        return self.folder / TABLE


def _trials(rows: list[dict[str, Any]], repetitions: int, seed: int) -> list[Trial]:
    """Every stimulus against the one with the most samples of its scene, set and filter, itself among them."""
    groups: dict[tuple[str, str, str], list[int]] = {}
    for number, row in enumerate(rows):
        groups.setdefault((row["scene"], row["point_set"], row["time_filter"]), []).append(number)
    pairs = [
        (test, max(members, key=lambda number: rows[number]["samples"]))
        for members in groups.values()
        if len(members) > 1
        for test in members
    ]
    rng = np.random.default_rng([seed, 0x5E5])
    asked = [(test, reference, repetition) for test, reference in pairs for repetition in range(repetitions)]
    order = rng.permutation(len(asked))
    sides, first = rng.integers(0, 2, len(asked)), rng.integers(0, 2, len(asked))
    trials = []
    for number, place in enumerate(order):
        test, reference, repetition = asked[place]
        side = ("left", "right")[sides[number]]
        trials.append(Trial(number, test, reference, repetition, side, bool(first[number])))
    return trials


def _stored(file: Path) -> list[dict[str, Any]]:
    """Answers on disk; a last line that was cut off by a crash does not count."""
    if not file.exists():
        return []
    lines = file.read_text().splitlines()
    found = []
    for number, line in enumerate(lines):
        try:
            found.append(json.loads(line))
        except ValueError:
            if number < len(lines) - 1:
                raise InputError(f"{file}:{number + 1}: expected an answer, got {line[:60]!r}") from None
            # what follows must begin on a line of its own
            file.write_text("".join(f"{json.dumps(row)}\n" for row in found))
    return found
