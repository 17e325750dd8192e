"""Sessions lose nothing and ask nothing twice."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from collections import Counter
from pathlib import Path

import pandas as pd
import pytest

from analysis.cli import InputError
from analysis.perception.observers import COLUMNS
from analysis.perception.protocol import TABLE, Session
from analysis.perception.server import serving
from tests.analysis.perception.builders import LEVELS, write_stimuli


@pytest.fixture
def stimuli(tmp_path: Path) -> Path:
    return write_stimuli(tmp_path / "stimuli")


def opened(tmp_path: Path, stimuli: Path, observer: str = "anna", repetitions: int = 4) -> Session:
    return Session(tmp_path / "session", stimuli, observer, repetitions, seed=3)


def test_every_stimulus_is_asked_as_often_as_told_on_either_side(tmp_path: Path, stimuli: Path) -> None:
    session = opened(tmp_path, stimuli, repetitions=20)
    assert Counter(trial.test for trial in session.trials) == {number: 20 for number in range(len(LEVELS))}
    assert {trial.reference for trial in session.trials} == {2}
    assert 20 < sum(trial.side == "left" for trial in session.trials) < 40
    assert [trial.number for trial in session.trials] == list(range(60))
    assert session.trials == opened(tmp_path, stimuli, repetitions=20).trials


def test_answers_are_on_disk_and_count_once(tmp_path: Path, stimuli: Path) -> None:
    session = opened(tmp_path, stimuli)
    assert session.answer(0, session.trials[0].side, {"response_s": 1.5, "dropped_frames": 2})
    assert not session.answer(0, "left", {})  # as after a reload
    with pytest.raises(ValueError, match="expected trial 1, got 5"):
        session.answer(5, "left", {})
    with pytest.raises(ValueError, match="left or right"):
        session.answer(1, "up", {})
    again = opened(tmp_path, stimuli)
    assert again.current is not None and again.current.number == 1
    table = again.table()
    assert tuple(table.columns[: len(COLUMNS)]) == COLUMNS and len(table) == 1
    row = table.iloc[0]
    assert (
        row["correct"] and row["observer_kind"] == "human" and row["response_s"] == 1.5 and row["dropped_frames"] == 2
    )


def test_a_line_cut_off_by_a_crash_is_asked_again(tmp_path: Path, stimuli: Path) -> None:
    session = opened(tmp_path, stimuli)
    for number in range(3):
        session.answer(number, "left", {})
    file = tmp_path / "session" / "answers.jsonl"
    file.write_text(file.read_text()[:-20])
    again = opened(tmp_path, stimuli)
    assert again.current is not None and again.current.number == 2
    again.answer(2, "right", {})
    assert [json.loads(line)["trial"] for line in file.read_text().splitlines()] == [0, 1, 2]
    lines = file.read_text().splitlines()
    file.write_text("\n".join(["nonsense", *lines]) + "\n")
    with pytest.raises(InputError, match=r"answers.jsonl:1: expected an answer"):
        opened(tmp_path, stimuli)


def test_a_session_belongs_to_one_person_and_its_stimuli(tmp_path: Path, stimuli: Path) -> None:
    opened(tmp_path, stimuli)
    with pytest.raises(InputError, match="expected a session of 'bert'"):
        opened(tmp_path, stimuli, "bert")
    other = write_stimuli(tmp_path / "others", side=8)
    with pytest.raises(InputError, match="with these stimuli, found another"):
        opened(tmp_path, other)
    with pytest.raises(InputError, match=r"expected .*manifest.json"):
        Session(tmp_path / "x", tmp_path / "nowhere", "anna", 4, 0)


def fetched(address: str, path: str, body: bytes | None = None) -> bytes:
    with urllib.request.urlopen(urllib.request.Request(address + path, body), timeout=10) as reply:
        return reply.read()


def test_the_server_hands_out_frames_and_takes_answers(tmp_path: Path, stimuli: Path) -> None:
    session = opened(tmp_path, stimuli)
    with serving(session, break_every=2) as address:
        assert address.startswith("http://127.0.0.1:")
        assert b"trial_page.js" in fetched(address, "") and b"requestAnimationFrame" in fetched(
            address, "trial_page.js"
        )
        state = json.loads(fetched(address, "state"))
        assert (state["done"], state["total"], state["rest"]) == (0, 12, False)
        assert fetched(address, "frame/0/1") == (stimuli / "planescene/hammersley-box-0001/frame00001.png").read_bytes()
        for path in ("frame/0/99", "frame/../../etc", "frame/9/0", "nothing"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                fetched(address, path)
        for number in range(2):
            state = json.loads(fetched(address, "answer", json.dumps({"trial": number, "answer": "left"}).encode()))
        assert (state["done"], state["rest"], state["trial"]["number"]) == (2, True, 2)
        for bad in (b"{}", b"nonsense", b'{"trial": 7, "answer": "left"}', b'{"trial": 2, "answer": "up"}'):
            with pytest.raises(urllib.error.HTTPError, match="400"):
                fetched(address, "answer", bad)
    assert len(pd.read_parquet(tmp_path / "session" / TABLE)) == 2
