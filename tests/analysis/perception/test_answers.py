"""The store of answers: what was acknowledged is there, and a file that is damaged is named."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from analysis.command.cli import InputError
from analysis.perception.answers import Answers, answers_of_lines

IDENTITY = {"observer": "anna", "seed": 3}
ROWS = [{"trial": number, "answer": ("left", "right")[number % 2], "response_s": 0.5} for number in range(9)]
FEEDER = """
import sys
from pathlib import Path
from analysis.perception.answers import Answers
store = Answers(Path(sys.argv[1]), {"observer": "anna", "seed": 3}, [{"trial": n} for n in range(2000)])
print("open", flush=True)
for number in range(len(store.rows()), 100_000):
    store.add({"trial": number})
    print(number, flush=True)
"""


def opened(file: Path) -> Answers:
    return Answers(file, IDENTITY)


def filled(file: Path) -> Path:
    store = opened(file)
    for row in ROWS:
        store.add(row)
    store.close()
    return file


def killed_feeder(file: Path, after_lines: int) -> int:
    """Kills a process that stores answers; returns the last acknowledged one, or -1."""
    with subprocess.Popen([sys.executable, "-c", FEEDER, str(file)], stdout=subprocess.PIPE, text=True) as feeder:
        assert feeder.stdout is not None
        lines = [feeder.stdout.readline() for _ in range(after_lines)]
        feeder.send_signal(signal.SIGKILL)
        lines += feeder.stdout.read().splitlines()
    told = [int(line) for line in lines if line.strip().isdigit()]
    return max(told, default=-1)


def assert_survives(file: Path, kills: int) -> None:
    for kill in range(kills):
        told = killed_feeder(file, kill % 7)
        if not file.exists():
            assert told < 0
            continue
        store = opened(file)
        trials = [row["trial"] for row in store.rows()]
        store.close()
        assert trials == list(range(len(trials))) and len(trials) > max(told, 1999)


def test_what_a_killed_process_acknowledged_is_there(tmp_path: Path) -> None:
    assert_survives(tmp_path / "answers.sqlite", kills=4)


@pytest.mark.slow
def test_what_fifty_killed_processes_acknowledged_is_there(tmp_path: Path) -> None:
    assert_survives(tmp_path / "answers.sqlite", kills=50)


def test_every_commit_waits_for_the_disk(tmp_path: Path) -> None:
    store = opened(tmp_path / "answers.sqlite")
    assert store._connection.execute("pragma synchronous").fetchone() == (3,)
    assert store._connection.execute("pragma journal_mode").fetchone() == ("delete",)
    store.close()


def test_a_disk_that_is_full_for_a_while_costs_no_answer(tmp_path: Path) -> None:
    file = filled(tmp_path / "answers.sqlite")
    store, limits = opened(file), resource.getrlimit(resource.RLIMIT_FSIZE)
    for size in (0, 10, 600, 5000):
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
        try:
            with pytest.raises(OSError, match=r"disk|full") as caught:
                store.add({"trial": 9, "answer": "left", "note": "x" * 9000})
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert caught.value.filename == str(file)
    assert store.rows() == ROWS
    store.add({"trial": 9})
    store.close()
    assert opened(file).rows() == [*ROWS, {"trial": 9}]


def test_a_store_of_another_session_is_refused(tmp_path: Path) -> None:
    file = filled(tmp_path / "answers.sqlite")
    with pytest.raises(InputError, match="expected a session of 'bert'"):
        Answers(file, {"observer": "bert", "seed": 3})


def flips_noticed(file: Path, count: int, seed: int) -> tuple[int, int]:
    """Numbers of flipped bits that are refused, and that change nothing."""
    whole, rng, found = file.read_bytes(), np.random.default_rng(seed), [0, 0]
    for place in rng.integers(0, 8 * len(whole), count):
        content = bytearray(whole)
        content[place // 8] ^= 1 << (place % 8)
        file.write_bytes(content)
        try:
            store = opened(file)
            assert store.rows() == ROWS, f"bit {place}"
            store.close()
            found[1] += 1
        except (InputError, OSError) as error:
            assert str(file) in str(error) or getattr(error, "filename", "") == str(file)
            found[0] += 1
    return found[0], found[1]


def test_flipped_bits_are_refused_or_change_nothing(tmp_path: Path) -> None:
    file = filled(tmp_path / "answers.sqlite")
    refused, harmless = flips_noticed(file, 400, 1)
    assert refused > 20 and refused + harmless == 400


@pytest.mark.parametrize("keep", [0, 1, 100, 4096, 9000])
def test_a_file_that_is_cut_off_is_named(tmp_path: Path, keep: int) -> None:
    file = filled(tmp_path / "answers.sqlite")
    file.write_bytes(file.read_bytes()[:keep])
    with pytest.raises(InputError, match=r"answers.sqlite: expected the answers of a session, found a damaged file"):
        opened(file)


@pytest.mark.parametrize(
    "statement",
    [
        "delete from answers where id = 9",
        "delete from answers where id = 4",
        "update answers set body = replace(body, 'left', 'right') where id = 1",
        "update session set answers = 8",
        "update session set token = 'mine'",
        "delete from session",
        "drop table answers",
    ],
)
def test_what_another_program_changed_is_noticed(tmp_path: Path, statement: str) -> None:
    import sqlite3

    file = filled(tmp_path / "answers.sqlite")
    with sqlite3.connect(file) as connection:
        connection.execute(statement)
    connection.close()
    with pytest.raises(InputError, match="damaged file"):
        opened(file)


def written(file: Path, *lines: str) -> Path:
    file.write_text("".join(lines))
    return file


def test_answers_of_earlier_versions_are_read_however_they_were_cut_off(tmp_path: Path) -> None:
    whole = [json.dumps(row) for row in ROWS[:4]]
    file = tmp_path / "answers.jsonl"
    missing_end = written(file, f"{whole[0]}\n", whole[1], f"{whole[2]}\n", whole[3])
    assert answers_of_lines(missing_end) == ROWS[:4]
    for cut in range(1, len(whole[2])):
        short = written(file, f"{whole[0]}\n{whole[1]}\n", whole[2][:cut], f"{whole[2]}\n{whole[3]}\n")
        assert answers_of_lines(short) == ROWS[:4], whole[2][:cut]
        assert answers_of_lines(written(file, f"{whole[0]}\n{whole[1]}\n", whole[2][:cut])) == ROWS[:2]
    twice = written(file, f"{whole[0]}\n", whole[0].replace("left", "right"), "\n", f"{whole[1]}\n")
    assert answers_of_lines(twice) == ROWS[:2]


@pytest.mark.parametrize("line", ["nonsense", '{"trial": 1}', '{"trial": 1, "answer": "lefu"}', "[[[["])
def test_another_line_in_answers_of_earlier_versions_is_named(tmp_path: Path, line: str) -> None:
    file = written(tmp_path / "answers.jsonl", json.dumps(ROWS[0]), "\n", line, "\n", json.dumps(ROWS[1]), "\n")
    with pytest.raises(InputError, match=r"answers.jsonl:2: expected an answer"):
        answers_of_lines(file)
