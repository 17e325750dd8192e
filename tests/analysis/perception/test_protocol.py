"""Sessions lose no answer, ask no question twice, and belong to one process at a time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pandas as pd
import pytest

from analysis.command.cli import InputError
from analysis.perception.observers import COLUMNS
from analysis.perception.protocol import TrialSession
from analysis.perception.stimuli import MANIFEST, write_manifest
from analysis.storage.files import write_json
from tests.analysis.perception.builders import LEVELS, write_stimuli


@pytest.fixture
def stimuli(tmp_path: Path) -> Path:
    return write_stimuli(tmp_path / "stimuli")


def opened(tmp_path: Path, stimuli: Path, observer: str = "anna", repetitions: int = 4) -> TrialSession:
    return TrialSession(tmp_path / "session", stimuli, observer, repetitions, seed=3)


def test_every_stimulus_is_asked_as_often_as_told_on_either_side(tmp_path: Path, stimuli: Path) -> None:
    with opened(tmp_path, stimuli, repetitions=20) as session:
        assert Counter(trial.test for trial in session.trials) == {number: 20 for number in range(len(LEVELS))}
        assert {trial.reference for trial in session.trials} == {2}
        assert 20 < sum(trial.side == "left" for trial in session.trials) < 40
        assert [trial.number for trial in session.trials] == list(range(60))
    with opened(tmp_path, stimuli, repetitions=20) as again:
        assert session.trials == again.trials


def test_answers_are_on_disk_and_count_once(tmp_path: Path, stimuli: Path) -> None:
    with opened(tmp_path, stimuli) as session:
        token = session.token
        assert session.answer(0, session.trials[0].side, {"response_s": 1.5, "dropped_frames": 2})
        assert not session.answer(0, "left", {})  # as after a reload
        with pytest.raises(ValueError, match="expected trial 1, got 5"):
            session.answer(5, "left", {})
        with pytest.raises(ValueError, match="left or right"):
            session.answer(1, "up", {})
    with opened(tmp_path, stimuli) as again:
        assert again.current is not None and again.current.number == 1 and again.token == token
        table = again.table()
    assert tuple(table.columns[: len(COLUMNS)]) == COLUMNS and len(table) == 1
    row = table.iloc[0]
    assert (
        row["correct"] and row["observer_kind"] == "human" and row["response_s"] == 1.5 and row["dropped_frames"] == 2
    )


@pytest.mark.parametrize(
    "fact",
    [
        {"dropped_frames": 10**400},
        {"dropped_frames": 1.5e300},
        {"refreshes": -1},
        {"response_s": float("nan")},
        {"response_s": float("inf")},
        {"response_s": "1"},
        {"display_rate_hz": True},
        {"device_pixel_ratio": [1]},
        {"fits_window": 1},
        {"mood": 3},
    ],
)
def test_a_fact_that_the_table_cannot_hold_is_refused(tmp_path: Path, stimuli: Path, fact: dict) -> None:
    (name,) = fact
    with opened(tmp_path, stimuli) as session:
        with pytest.raises(ValueError, match=f"answer: expected {name} (between|true)"):
            session.answer(0, "left", fact)
        assert not session.answers
        session.answer(0, "left", {"dropped_frames": 10**9, "response_s": None})
        assert pd.read_parquet(session.export())["dropped_frames"].tolist() == [10**9]


def test_a_session_is_open_in_one_process(tmp_path: Path, stimuli: Path) -> None:
    source = (
        "import sys; from pathlib import Path; from analysis.perception.protocol import TrialSession; "
        "TrialSession(Path(sys.argv[1]), Path(sys.argv[2]), 'anna', 4, 3)"
    )
    command = [sys.executable, "-c", source, str(tmp_path / "session"), str(stimuli)]
    with opened(tmp_path, stimuli):
        second = subprocess.run(command, capture_output=True, text=True)
        assert second.returncode == 1
        assert f"out: {tmp_path / 'session'} is in use by process {os.getpid()} on " in second.stderr
        with pytest.raises(ValueError, match="is in use by process"):
            opened(tmp_path, stimuli)
    assert subprocess.run(command, capture_output=True).returncode == 0
    opened(tmp_path, stimuli).close()


def begun_earlier(tmp_path: Path, stimuli: Path) -> Path:
    """A session as earlier versions kept it, without answers."""
    rows = json.loads((stimuli / MANIFEST).read_text())["stimuli"]
    identity = {"observer": "anna", "repetitions": 4, "seed": 3, "sha256": [row["sha256"] for row in rows]}
    write_json(tmp_path / "session" / "session.json", identity)
    return tmp_path / "session" / "answers.jsonl"


def test_a_session_of_an_earlier_version_goes_on(tmp_path: Path, stimuli: Path) -> None:
    file = begun_earlier(tmp_path, stimuli)
    first = {"trial": 0, "answer": "left", "response_s": 2.5, "dropped_frames": 10**400, "fits_window": True}
    lines = [json.dumps(row) for row in (first, {"trial": 1, "answer": "right"}, {"trial": 2, "answer": "left"})]
    file.write_text(f"{lines[0]}\n{lines[1]}{lines[2][:-5]}")  # a line without an end, and a truncated write
    before = file.read_bytes()
    with opened(tmp_path, stimuli) as session:
        assert session.current is not None and session.current.number == 2
        session.answer(2, "right", {})
        table = pd.read_parquet(session.export())
    assert table["answer"].tolist() == ["left", "right", "right"] and table["dropped_frames"].tolist() == [-1, -1, -1]
    assert table["response_s"][0] == 2.5 and table["fits_window"].tolist() == [True, False, False]
    assert file.read_bytes() == before
    file.write_text("nonsense")  # is read once
    with opened(tmp_path, stimuli) as again:
        assert len(again.answers) == 3


def test_a_damaged_session_of_an_earlier_version_is_named(tmp_path: Path, stimuli: Path) -> None:
    file = begun_earlier(tmp_path, stimuli)
    file.write_text('nonsense\n{"trial": 0, "answer": "left"}\n')
    with pytest.raises(InputError, match=r"answers.jsonl:1: expected an answer"):
        opened(tmp_path, stimuli)
    file.unlink()
    with pytest.raises(InputError, match=r"session.json: expected a session of 'bert'"):
        opened(tmp_path, stimuli, "bert")
    file.with_name("session.json").write_bytes(b"\xff{")
    with pytest.raises(InputError, match=r"session.json: expected a session, found a damaged file"):
        opened(tmp_path, stimuli)


def test_a_session_belongs_to_one_person_and_its_stimuli(tmp_path: Path, stimuli: Path) -> None:
    opened(tmp_path, stimuli).close()
    with pytest.raises(InputError, match="expected a session of 'bert'"):
        opened(tmp_path, stimuli, "bert")
    other = write_stimuli(tmp_path / "others", side=8)
    with pytest.raises(InputError, match="with these stimuli, found another"):
        opened(tmp_path, other)
    with pytest.raises(InputError, match=r"expected .*manifest.json"):
        TrialSession(tmp_path / "x", tmp_path / "nowhere", "anna", 4, 0)


def test_a_manifest_that_says_something_else_is_another_session(tmp_path: Path, stimuli: Path) -> None:
    opened(tmp_path, stimuli).close()
    whole = (stimuli / MANIFEST).read_text()
    write_manifest(stimuli, json.loads(whole.replace('"samples": 8', '"samples": 9')))
    with pytest.raises(InputError, match="with these stimuli, found another"):
        opened(tmp_path, stimuli)
    for other in ("{}", whole.replace('"folder"', '"golder"'), whole.replace('"samples": 8', '"samples": "8"')):
        write_manifest(stimuli, json.loads(other))
        with pytest.raises(InputError, match=r"expected .*manifest.json, written by the command 'stimuli'"):
            opened(tmp_path, stimuli)


def test_a_manifest_is_as_it_was_written(tmp_path: Path, stimuli: Path, capsys: pytest.CaptureFixture) -> None:
    """A level that flipped would put answers beside the wrong number of samples."""
    whole = (stimuli / MANIFEST).read_text()
    for damaged in (whole.replace('"samples": 8', '"samples": 9'), whole[:-20], "[]"):
        (stimuli / MANIFEST).write_text(damaged)
        with pytest.raises(InputError, match=r"expected .*manifest.json, written by the command 'stimuli'"):
            opened(tmp_path, stimuli)
    assert capsys.readouterr().err == "", "the error says it all"
