"""A session of the study with a person: its trials, and answers that are on disk before they count."""

from __future__ import annotations

import contextlib
import hashlib
import json
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.command.cli import InputError
from analysis.command.ownership import owned
from analysis.perception.answers import Answers, answers_of_lines
from analysis.perception.observers import COLUMNS
from analysis.perception.stimuli import COLUMNS as STIMULUS
from analysis.perception.stimuli import check_frames, png_of, read_manifest
from analysis.storage.files import atomic, write_table

HUMAN_TASK = "dual pair"
TABLE = "trials-human.parquet"
_STORE, _LOCK = "answers.sqlite", "session.lock"
_OLD_SESSION, _OLD_ANSWERS = "session.json", "answers.jsonl"

_MOST = {
    "response_s": 1e8, "display_rate_hz": 1e6, "dropped_frames": 10**9, "refreshes": 10**9, "device_pixel_ratio": 1e3,
    "videos": 4,
}  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """One question: which of two pairs differs.

    Attributes:
        number: number in the session, from 0.
        test, reference: indices of stimuli in the manifest; the other pair shows the reference twice.
        repetition: repetition of the stimulus, from 0.
        side: ``left`` or ``right``, the side of the pair that differs.
        test_first: whether the test is the upper stimulus of that pair.
    """

    number: int
    test: int
    reference: int
    repetition: int
    side: str
    test_first: bool


class TrialSession:
    """The trials of one person, in a folder of their own; a session that is opened again continues where it was.

    One process at a time may have it open.

    Attributes:
        fault: why a stimulus cannot be shown, or None.
    """

    def __init__(self, folder: Path, stimuli: Path, observer: str, repetitions: int, seed: int) -> None:
        """Opens the session of a folder, or begins it.

        Args:
            folder: folder of the session.
            stimuli: folder of the stimuli.
            observer: name of the person, which must be that of an earlier session in the folder.
            repetitions: number of trials of each stimulus.
            seed: seed of orders and sides.

        Raises:
            ValueError: another process has the session open.
            InputError: the folder holds a session of another person or other stimuli, one of its files is damaged, or
                there is nothing to compare.
            OSError: the folder cannot be written.
        """
        self.folder, self.stimuli = folder, stimuli
        self.manifest = read_manifest(stimuli)
        self.rows: list[dict[str, Any]] = self.manifest["stimuli"]
        self.observer = observer
        self.fault: InputError | None = None
        self._checked: set[int] = set()
        self._answering = threading.Lock()
        self.trials = _trials(self.rows, repetitions, seed)
        if not self.trials:
            raise InputError("stimuli: expected two levels of a scene, set and filter at least, got one")
        folder.mkdir(parents=True, exist_ok=True)
        shown = [[row[name] for name in STIMULUS] for row in self.rows]
        person = {"observer": observer, "repetitions": repetitions, "seed": seed}
        with contextlib.ExitStack() as held:
            held.enter_context(owned(folder / _LOCK, "out"))
            file = folder / _STORE
            earlier = (
                [] if file.exists() else _earlier(folder, {**person, "sha256": [row["sha256"] for row in self.rows]})
            )
            timing = [self.manifest["frame_rate_hz"], self.manifest["size_px"]]
            identity = {**person, "stimuli": hashlib.sha256(json.dumps([shown, timing]).encode()).hexdigest()}
            self._store = held.enter_context(contextlib.closing(Answers(file, identity, earlier)))
            self.answers: dict[int, dict[str, Any]] = {row["trial"]: row for row in self._store.rows()}
            self._held = held.pop_all()

    def __enter__(self) -> TrialSession:
        return self

    def __exit__(self, *caught: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the session, so that other processes can open it."""
        self._held.close()

    @property
    def token(self) -> str:
        """Secret of this session's page, the same whenever the session is opened."""
        return self._store.token

    @property
    def current(self) -> Trial | None:
        """The first trial without an answer; None if all are answered."""
        return next((trial for trial in self.trials if trial.number not in self.answers), None)

    def answer(self, number: int, side: str, facts: dict[str, Any]) -> bool:
        """Stores an answer, durably, if the trial has none.

        Args:
            number: number of the trial.
            side: the chosen side.
            facts: measurements of the page: seconds to the answer, display rate, dropped frames, window.

        Returns:
            Whether it was stored; False if the trial was answered before.

        Raises:
            ValueError: there is no such trial, it is not the current one, the side is neither left nor right, or a
                measurement is invalid.
            OSError: the answer cannot be stored, and does not count.
        """
        if side not in ("left", "right"):
            raise ValueError(f"answer: expected left or right, got {str(side)[:40]!r}")
        row = {"trial": number, "answer": side, **checked_facts(facts)}
        with self._answering:
            if number in self.answers:
                return False
            if self.current is None or number != self.current.number:
                raise ValueError(f"answer: expected trial {self.current and self.current.number}, got {number}")
            self._store.add(row)
            self.answers[number] = row
        return True

    def frame(self, stimulus: int, number: int) -> bytes:
        """A frame of a stimulus as a PNG file.

        Raises:
            IndexError: there is no such frame.
            InputError: the stimulus has changed since it was rendered; ``fault`` then says so.
        """
        row = self.rows[stimulus]
        file = self.stimuli / row["folder"] / row["files"][number]
        try:
            if stimulus not in self._checked:
                check_frames(self.stimuli, row)
                self._checked.add(stimulus)
            return png_of(file)
        except OSError as error:
            self.fault = InputError(f"stimuli: {file}: cannot be read ({error.strerror or error})")
        except InputError as error:
            self.fault = error
        raise self.fault

    def table(self) -> pd.DataFrame:
        """The answered trials, with the columns of simulated ones and the measurements of the page."""
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
                    "videos": answer.get("videos", 4),
                }
            )
        extra = ["display_rate_hz", "dropped_frames", "fits_window", "videos"]
        return pd.DataFrame(rows, columns=[*COLUMNS, *extra])

    def export(self) -> Path:
        """Writes the table; returns its path."""
        with atomic(self.folder / TABLE) as path:
            self.table().to_parquet(path, index=False)
        write_table(self.folder / Path(TABLE).with_suffix(".csv"), self.table())
        return self.folder / TABLE


def _trials(rows: list[dict[str, Any]], repetitions: int, seed: int) -> list[Trial]:
    """Trials of every stimulus against that with the most samples of its scene, set and filter, including itself."""
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


def checked_facts(facts: Mapping[str, Any]) -> dict[str, float | bool]:
    """Measurements of a page, in the types of the table; missing ones (None) are left out.

    Raises:
        ValueError: a name is unknown, or a value is not a number in the range of the table.
    """
    found: dict[str, float | bool] = {}
    for name, value in facts.items():
        if value is None:
            continue
        if name == "fits_window" and isinstance(value, bool):
            found[name] = value
        elif name in _MOST and _is_number(value) and 0 <= value <= _MOST[name]:
            found[name] = type(_MOST[name])(value)
        else:
            expected = f"between 0 and {_MOST[name]:g}" if name in _MOST else "true or false"
            raise ValueError(f"answer: expected {name[:40]} {expected}, got {str(value)[:40]}")
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _earlier(folder: Path, identity: dict[str, Any]) -> list[dict[str, Any]]:
    """Answers of a session that an earlier version began.

    Raises:
        InputError: the session is another one, or a file of it is damaged.
    """
    file = folder / _OLD_SESSION
    if not file.exists():
        return []
    try:
        begun = json.loads(file.read_bytes())
    except ValueError as error:
        raise InputError(f"out: {file}: expected a session, found a damaged file ({error})") from None
    if begun != identity:
        raise InputError(
            f"out: {file}: expected a session of {identity['observer']!r} with these stimuli, found another"
        )
    answers = folder / _OLD_ANSWERS
    found = answers_of_lines(answers) if answers.exists() else []
    for number, row in enumerate(found):
        facts = {name: value for name, value in row.items() if name not in ("trial", "answer")}
        for name in list(facts):
            try:
                checked_facts({name: facts[name]})
            except ValueError:  # an earlier version accepted anything; the answer still counts
                del facts[name]
        found[number] = {"trial": row["trial"], "answer": row["answer"], **checked_facts(facts)}
    return found
