"""Folders of results: what a user has there stays, what commands made is replaced."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.command.ownership import release_folders
from analysis.storage.results import own_results, reserved
from analysis.storage.store import JOURNAL, Store
from renderer.compute import device
from tests.durable import KINDS
from tests.scripts.commands import call_script, one_line

NAMES = ("film.mp4", "tables/*.csv")


def taken(folder: Path, names: tuple[str, ...] = NAMES) -> None:
    try:
        own_results(folder, names)
    finally:
        release_folders()


@pytest.mark.parametrize("name", ["summary.json", "film.mp4", "tables/mine.csv"])
def test_a_file_of_the_user_is_named_and_stays(name: str, tmp_path: Path) -> None:
    (tmp_path / "tables").mkdir()
    (tmp_path / "notes.txt").write_text("free")
    (tmp_path / name).write_text("mine")
    for _ in range(2):
        with pytest.raises(ValueError, match=rf"^out: expected no file .* did not make, found .*/{name}; move it$"):
            taken(tmp_path)
    assert (tmp_path / name).read_text() == "mine"
    (tmp_path / name).unlink()
    taken(tmp_path)


def test_what_commands_made_may_be_replaced(tmp_path: Path) -> None:
    """Whether it was listed, or left by a command that was killed, or made by a version that listed nothing."""
    taken(tmp_path)
    (tmp_path / "film.mp4").write_text("made")
    taken(tmp_path)
    (tmp_path / "more.csv").write_text("mine")
    with pytest.raises(ValueError, match=r"more\.csv"):
        taken(tmp_path, ("more.csv",))
    Store(tmp_path, "key").write_json("listed.json", {})
    taken(tmp_path, ("listed.json",))
    earlier = tmp_path / "earlier"
    earlier.mkdir()
    (earlier / "film.mp4").write_text("made")
    (earlier / "summary.json").write_text(json.dumps({"config": {}, "provenance": {}}))
    taken(earlier)


COMMANDS = {
    "run.py": ("fly-by", "--no-film", "--seconds", "0.2", "--resolution-px", "64", "--batch-size", "16"),
    "inputs.py": ("fly-by", "--repetitions", "1", "--seconds", "0.2", "--resolution-px", "64", "--batch-size", "16"),
    "render.py": ("plain", "--width-px", "24", "--height-px", "24"),
    "gallery.py": ("glass", "--width-px", "16", "--height-px", "16", "--samples", "1"),
    "job.py": ("job.txt", "--width-px", "16", "--frames", "1"),
    "pointsets.py": (),
    "cost_report.py": (),
    "spectrum.py": (),
    "ablation.py": (),
    "precision.py": (),
    "workloads.py": (),
    "suitability.py": ("--inputs", "fly-by", "--rows", "0"),
    "sensitivity.py": (),
    "accelerators.py": (),
    "bench.py": (),
    "perception.py": ("stimuli", "job.txt"),
}


@pytest.mark.parametrize("script", COMMANDS)
def test_every_command_leaves_a_summary_of_the_user(
    script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    KINDS["job"].prepare(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(device, "_loaded", set())
    monkeypatch.setattr(device.wp, "load_module", lambda *_, **__: pytest.fail("kernels are loaded before the check"))
    (tmp_path / "out").mkdir()
    for name in ("summary.json", "error.png"):
        (tmp_path / "out" / name).write_text("mine")
    assert call_script(script, monkeypatch, *COMMANDS[script], "--out", "out") == 2
    shown = capsys.readouterr()
    assert shown.out == "" and one_line(shown.err) and "did not make" in shown.err
    assert sorted(path.name for path in Path("out").iterdir()) == ["error.png", "summary.json"]
    assert {path.read_text() for path in Path("out").iterdir()} == {"mine"}


KINDS_OF_OUT = ["run", pytest.param("inputs", marks=pytest.mark.slow), "render", "job", "tiles", "stimuli"]


@pytest.mark.parametrize("kind", KINDS_OF_OUT)
def test_what_a_command_makes_it_has_named(kind: str, tmp_path: Path) -> None:
    """Made once; every file is on a list, or of a name that was taken."""
    KINDS[kind].prepare(tmp_path)
    given = {path for path in tmp_path.rglob("*")}
    assert KINDS[kind].make(tmp_path) == 0
    release_folders()
    known = {file for journal in tmp_path.rglob("files.journal") for file in _named(journal)}
    made = {path for path in (tmp_path / "out").rglob("*") if path.is_file() and path.suffix != ".journal"} - given
    assert made - known == set()


def _named(journal: Path) -> list[Path]:
    rows = [json.loads(line.partition(" ")[2]) for line in journal.read_text().splitlines()]
    patterns = [name for row in rows for name in row.get("taken", [row.get("name")])]
    return [file for pattern in patterns for file in journal.parent.glob(pattern)]


def test_a_command_that_was_killed_goes_on(tmp_path: Path) -> None:
    """What it left has names that it had taken before."""
    root = Path(__file__).resolve().parents[3]
    killed = (
        "import os, sys; from pathlib import Path; from analysis.storage.results import own_results;"
        "own_results(Path(sys.argv[1]), ['film.mp4']); Path(sys.argv[1], 'film.mp4').write_text('half');"
        "os.kill(os.getpid(), 9)"
    )
    status = subprocess.run([sys.executable, "-c", killed, str(tmp_path)], cwd=root, env=os.environ).returncode
    assert status == -9 and (tmp_path / "film.mp4").exists()
    taken(tmp_path, ("film.mp4",))


@pytest.mark.parametrize(("file", "before", "kept"), [("", False, False), ("a.csv", False, True), ("", True, True)])
def test_names_stay_reserved_unless_the_input_was_refused(tmp_path: Path, file: str, before: bool, kept: bool) -> None:
    if before:
        taken(tmp_path, ("a.csv",))
    with pytest.raises(ValueError, match="no such table"), reserved(tmp_path, ("a.csv",)):
        assert (tmp_path / JOURNAL).exists()
        if file:
            (tmp_path / file).touch()
        raise ValueError("no such table")
    assert (tmp_path / JOURNAL).exists() == kept
