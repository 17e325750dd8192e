"""A command finds a file on disk unchanged or not at all: truncated, changed, exchanged and foreign files are
missing."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.storage.journal import Journal
from analysis.storage.store import JOURNAL, Store, read_json


def write(store: Store, name: str, content: bytes, **facts: Any) -> None:
    with store.make(name) as made:
        made.path.write_bytes(content)
        made.facts |= facts


def test_a_file_is_found_as_it_was_made(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    store = Store(tmp_path, "k")
    assert store.find("a.bin") is None and store.read("a.bin") is None and store.listed() == set()
    write(store, "a.bin", b"first", nonfinite=3)
    write(store, "deep/b.bin", b"second")
    for one in (store, Store(tmp_path, "k")):
        found = one.find("a.bin")
        assert found is not None and found.facts == {"nonfinite": 3} and one.read("deep/b.bin") == b"second"
        assert one.listed() == {"a.bin", "deep/b.bin"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bin", "deep", JOURNAL]
    assert capsys.readouterr().err == ""


def test_what_another_key_made_is_not_there_and_goes_without_a_word(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    old, new = Store(tmp_path, "old"), Store(tmp_path, "new")
    write(old, "a", b"old")
    assert new.find("a") is None and new.read("a") is None and new.listed() == {"a"}
    write(new, "a", b"new")
    assert new.read("a") == b"new" and old.find("a") is None
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("bit", [0, 7, 8 * 2 + 5, 8 * 4 + 7])
def test_a_changed_bit_is_named_and_the_file_does_not_count(
    bit: int, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    store = Store(tmp_path, "k")
    write(store, "a", b"right")
    content = bytearray(b"right")
    content[bit // 8] ^= 1 << bit % 8
    (tmp_path / "a").write_bytes(content)
    assert store.find("a") is None and store.read("a") is None
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and str(tmp_path / "a") in error and "is made again" in error
    write(store, "a", b"right")
    assert store.read("a") == b"right"


@pytest.mark.parametrize("damage", ["cut", "longer", "folder", "exchanged"])
def test_other_content_does_not_count(damage: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    store, file = Store(tmp_path, "k"), tmp_path / "a"
    write(store, "a", b"right")
    write(store, "b", b"other")
    if damage == "folder":
        file.unlink()
        file.mkdir()
    elif damage == "exchanged":
        file.unlink()
        (tmp_path / "b").rename(file)
    else:
        file.write_bytes(b"righ" if damage == "cut" else b"rights")
    assert store.find("a") is None and "a: is damaged" in capsys.readouterr().err


def test_a_missing_file_does_not_count_and_is_nothing_to_speak_of(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    store = Store(tmp_path, "k")
    write(store, "a", b"right")
    (tmp_path / "a").unlink()
    assert store.find("a") is None and store.read("a") is None and capsys.readouterr().err == ""


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_failed_replacement_leaves_what_was_there(tmp_path: Path, error: type[BaseException]) -> None:
    store = Store(tmp_path, "k")
    write(store, "a", b"old")
    with pytest.raises(error), store.make("a") as made:
        made.path.write_bytes(b"half")
        raise error
    assert store.read("a") == b"old"


@pytest.mark.parametrize("seed", range(20))
def test_no_bit_of_the_list_can_change_and_give_another_answer(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    store = Store(tmp_path, "k")
    facts = {name: {"nonfinite": number} for number, name in enumerate("abc")}
    for name in facts:
        write(store, name, name.encode() * 5, **facts[name])
    content = bytearray((tmp_path / JOURNAL).read_bytes())
    bit = int(np.random.default_rng(seed).integers(8 * len(content)))
    content[bit // 8] ^= 1 << bit % 8
    (tmp_path / JOURNAL).write_bytes(content)
    found = Store(tmp_path, "k")
    kept = {name: entry.facts for name in facts if (entry := found.find(name)) is not None}
    assert kept.items() <= facts.items() and 1 <= len(kept) < 3
    assert "damaged line" in capsys.readouterr().err or content[-1] != ord("\n"), "an end that is missing is a cut"
    for name in facts.keys() - kept.keys():
        write(found, name, name.encode() * 5, **facts[name])
    again = Store(tmp_path, "k")
    assert all(again.read(name) == name.encode() * 5 for name in facts), "the list can be added to"


@pytest.mark.parametrize("length", range(0, 140, 7))
def test_a_list_that_was_cut_off_can_be_added_to(length: int, tmp_path: Path) -> None:
    store = Store(tmp_path, "k")
    write(store, "a", b"first")
    (tmp_path / JOURNAL).write_bytes((tmp_path / JOURNAL).read_bytes()[:length])
    other = Store(tmp_path, "k")
    write(other, "b", b"second")
    assert Store(tmp_path, "k").read("b") == b"second" and Store(tmp_path, "k").read("a") in (None, b"first")


def _add(path: Path, process: int) -> None:
    for number in range(50):
        Journal(path).append({"process": process, "number": number, "text": "x" * 200})


def test_several_processes_add_to_one_list(tmp_path: Path) -> None:
    context = multiprocessing.get_context("fork")
    processes = [context.Process(target=_add, args=(tmp_path / "j", number)) for number in range(4)]
    journal = Journal(tmp_path / "j")
    assert journal.rows() == []
    for process in processes:
        process.start()
    for process in processes:
        process.join(60)
    for number in range(4):
        assert [row["number"] for row in journal.rows() if row["process"] == number] == list(range(50))


def test_what_others_add_is_seen_and_read_once(tmp_path: Path) -> None:
    one, other = Store(tmp_path, "k"), Store(tmp_path, "k")
    write(one, "a", b"1")
    assert other.read("a") == b"1"
    write(one, "b", b"2")
    assert other.read("b") == b"2" and other.listed() == {"a", "b"}
    (tmp_path / JOURNAL).unlink()
    assert other.find("a") is None and other.listed() == set(), "without a list nothing counts"


def _make_until_killed(folder: Path) -> None:
    store = Store(folder, "k")
    for number in range(100_000):
        write(store, f"{number % 7}", b"%d" % (number % 7) * 1000, number=number % 7)


@pytest.mark.parametrize("after_s", [0.01, 0.05, 0.11])
def test_a_process_may_be_killed_at_any_moment(after_s: float, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Every listed file is complete, and missing ones can be made. The same content is written again and again."""
    process = multiprocessing.get_context("fork").Process(target=_make_until_killed, args=(tmp_path,))
    process.start()
    process.join(after_s)
    os.kill(process.pid or 0, signal.SIGKILL)
    process.join(20)
    store = Store(tmp_path, "k")
    for number in range(7):
        entry = store.find(f"{number}")
        if entry is not None:
            assert entry.facts == {"number": number} and store.read(f"{number}") == b"%d" % number * 1000
        elif (tmp_path / f"{number}").exists():
            pytest.fail("a file that is on disk is on the list")
        write(store, f"{number}", b"%d" % number * 1000, number=number)
        assert store.find(f"{number}") is not None
    assert capsys.readouterr().err == "", "a kill damages nothing"


def test_content_list_and_names_are_on_the_disk_in_that_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a power cut as after a kill: what is not synced may be missing, whatever was written later."""
    store, done, sync, move = Store(tmp_path, "k"), list[str](), os.fsync, os.replace
    write(store, "other", b"1")

    def synced(handle: int) -> None:
        done.append(Path(os.readlink(f"/proc/self/fd/{handle}")).name)
        sync(handle)

    def moved(source: Path, target: Path) -> None:
        done.append("moved")
        move(source, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", moved)
    write(store, "a.bin", b"content")
    assert done == [JOURNAL, "a.partial.bin", "moved", tmp_path.name]
    done.clear()
    Journal(tmp_path / "new").append({})
    assert done == ["new", tmp_path.name]


def test_only_what_is_listed_is_deleted(tmp_path: Path) -> None:
    store = Store(tmp_path, "k")
    write(Store(tmp_path, "old"), "frame1", b"1")
    write(store, "frame2", b"2")
    (tmp_path / "frame-notes.md").write_text("mine")
    assert store.discard(["frame1", "frame-notes.md", "frame3"]) == ["frame1"]
    assert sorted(path.name for path in tmp_path.iterdir()) == [JOURNAL, "frame-notes.md", "frame2"]
    assert store.listed() == Store(tmp_path, "k").listed() == {"frame2"}
    write(store, "frame1", b"new")
    assert store.discard(["frame1"]) == ["frame1"] and not (tmp_path / "frame1").exists()


EXPECTED = {"count": int, "ratios": list[float], "source": {"commit": str}}


def test_json_that_was_expected_is_read(tmp_path: Path) -> None:
    value = {"count": 3, "ratios": [0.5, 1], "source": {"commit": "c", "more": None}, "more": True}
    store = Store(tmp_path, "k")
    store.write_json("a.json", value, images=2)
    assert store.read_json("a.json", EXPECTED) == value and store.find("a.json").facts == {"images": 2}  # type: ignore
    assert read_json(tmp_path / "a.json", EXPECTED) == value and store.read_json("b.json", EXPECTED) is None
    (tmp_path / "a.json").write_text(json.dumps(value))
    assert store.read_json("a.json", EXPECTED) is None, "written by another hand"


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "expected JSON"),
        ("{", "expected JSON"),
        ("[" * 100_000, "expected JSON"),
        (b"\xff\xfe", "expected JSON"),
        ("[]", "expected an object with count, ratios, source, rows, got []"),
        ("7", "got 7"),
        ("{}", "expected 'count', got only []"),
        ('{"count": 1.5, "ratios": [], "source": {"commit": ""}}', "count: expected int, got 1.5"),
        ('{"count": 1, "ratios": [1, "x"], "source": {"commit": ""}}', "ratios: expected list[float], got [1, "),
        ('{"count": 1, "ratios": [], "source": null}', "source: expected an object with commit, got null"),
        ('{"count": 1, "ratios": [], "source": {"commit": null}}', "source: commit: expected str, got null"),
        ('{"count": 1, "ratios": [], "source": {"commit": ""}, "rows": 3}', "rows: expected list, got 3"),
        ('{"count": 1, "ratios": [], "source": {"commit": ""}, "rows": [{"a": 1}, {}]}', "rows: 1: expected 'a'"),
    ],
)
def test_json_that_was_not_expected_is_one_line_that_names_file_and_place(
    text: str | bytes, part: str, tmp_path: Path
) -> None:
    file = tmp_path / "a.json"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError) as caught:
        read_json(file, {**EXPECTED, "rows": [{"a": int}]})
    assert str(file) in str(caught.value) and part in str(caught.value) and "\n" not in str(caught.value)
