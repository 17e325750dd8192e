"""Commands under the rules of Windows, as far as Linux can have them: see ``sitecustomize.py`` beside this file."""

from __future__ import annotations

import ast
import io
import os
import subprocess
import sys
from pathlib import Path, PureWindowsPath

import pytest

from analysis.command import ownership
from analysis.storage import journal
from analysis.storage.files import plain
from analysis.storage.sameness import compare_folders
from tests.scripts.commands import ROOT, one_line

RULES = {"PYTHONPATH": os.pathsep.join((str(Path(__file__).parent), str(ROOT))), "PYTHONIOENCODING": "cp1252"}
PACKAGES = ("tsar", "renderer", "scenes", "analysis", "scripts", "docs")


def run(*command: str, folder: Path, rules: bool = True) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, **(RULES if rules else {})}
    return subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        env=environment,
        capture_output=True,
        encoding="cp1252" if rules else "utf-8",
        timeout=600,
    )


def changed_ends(folder: Path) -> list[Path]:
    """Files of text whose lines end as on Windows."""
    kinds = {".csv", ".html", ".json", ".md", ".svg"}
    texts = [file for file in folder.rglob("*") if file.suffix in kinds]
    assert texts
    return [file for file in texts if b"\r\n" in file.read_bytes()]


def script(name: str, *arguments: str, folder: Path, rules: bool = True) -> str:
    done = run(str(ROOT / "scripts" / name), *arguments, folder=folder, rules=rules)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("open('a:b', 'w')", "no file can be named 'a:b'"),
        ("open('aux.txt', 'wb')", "no file can be named 'aux.txt'"),
        ("os.mkdir('part.')", "no file can be named 'part.'"),
        ("open('Some', 'w').close(); open('sOME', 'w')", "this is the file 'Some'"),
        ("os.open('.', os.O_RDONLY)", "a folder cannot be opened"),
        ("open('a', 'w').close(); os.fsync(os.open('a', os.O_RDONLY))", "cannot be flushed"),
        ("open('a', 'w').close(); held = open('a'); os.remove('a')", "the file is open"),
        ("open('a', 'w').close(); open('b', 'w').close(); held = open('b'); os.replace('a', 'b')", "the file is open"),
        ("open('a', 'w').close(); open('b', 'w').close(); os.rename('a', 'b')", "rename replaces nothing"),
        ("open('a', 'wb').write(b'x'); import numpy as np; held = np.memmap('a', mode='r'); os.remove('a')", "is open"),
        ("open('a', 'w').write('θ')", "can't encode character"),
        ("os.fork()", "no attribute 'fork'"),
        ("print('θ')", "can't encode character"),
    ],
)
def test_the_rules_are_kept(program: str, reason: str, tmp_path: Path) -> None:
    done = run("-c", f"import os; {program}", folder=tmp_path)
    assert done.returncode == 1 and reason in done.stderr, done.stderr


def test_lines_of_text_end_as_there(tmp_path: Path) -> None:
    done = run("-c", "open('a', 'w').write('one\\ntwo')", folder=tmp_path)
    assert done.returncode == 0 and (tmp_path / "a").read_bytes() == b"one\r\ntwo"


@pytest.mark.slow
def test_a_run_has_the_same_files(tmp_path: Path) -> None:
    """A comparison with its page, film and records, and the page of two runs."""
    small = ("plain", "--resolution-px", "64", "--seconds", "0.2", "--batch-size", "2", "--out")
    for rules in (True, False):
        folder = tmp_path / ("there" if rules else "here")
        folder.mkdir()
        shown = script("run.py", *small, "one", folder=folder, rules=rules)
        assert f"look at it: {(folder / 'one' / 'report.html').as_uri()}" in shown
    found = compare_folders(tmp_path / "there", tmp_path / "here")
    assert found.compared >= 3 and not found.found, found.found
    assert not changed_ends(tmp_path / "there")


def test_scenes_are_converted_to_the_same_bytes(tmp_path: Path) -> None:
    scene = ROOT / "scenes" / "assets" / "cornell-box" / "cornell-box.pbrt"
    for rules in (True, False):
        for ending in (".xml", ".gltf"):
            folder = tmp_path / ("there" if rules else "here")
            script("convert.py", str(scene), str(folder / f"Box{ending}"), folder=tmp_path, rules=rules)
    there, here = (
        {file.relative_to(folder): file.read_bytes() for file in folder.rglob("*") if file.is_file()}
        for folder in (tmp_path / "there", tmp_path / "here")
    )
    assert len(there) >= 4 and there.keys() == here.keys()
    assert not [name for name in there if there[name] != here[name] and "losses" not in name.name]


def test_tiles_are_rendered_by_processes_that_are_spawned(tmp_path: Path) -> None:
    """There is no fork. Files are those of a single process."""
    small = ("plain", "--size", "40x30", "--samples", "4", "--out")
    script("tiles.py", *small, "two", "--workers", "2", folder=tmp_path)
    script("tiles.py", *small, "one", "--workers", "1", folder=tmp_path, rules=False)
    assert (tmp_path / "two" / "plain.exr").read_bytes() == (tmp_path / "one" / "plain.exr").read_bytes()


@pytest.mark.slow
def test_a_study_of_two_processes_has_the_same_tables(tmp_path: Path) -> None:
    """Processes are spawned; keys of results, which hash paths and sources, are those of Linux."""
    small = ("--inputs", "plain", "--rows", "0", "--policy-row", "0", "--repetitions", "1", "--jod-repetitions", "0")
    names = {}
    for folder in ("there", "here"):
        more = ("--rivals", "framed-1", "--workers", "2", "--references", f"{folder}-cache", "--out", folder)
        script("suitability.py", *small, *more, folder=tmp_path, rules=folder == "there")
        names[folder] = {file.name for file in (tmp_path / folder / "runs").glob("*.json")}
    found = compare_folders(tmp_path / "there", tmp_path / "here", ("seconds", "references"))
    assert names["there"] == names["here"] and len(names["here"]) == 5
    assert found.compared > 20 and not found.found, found.found
    assert not changed_ends(tmp_path / "there")


@pytest.mark.slow
def test_stimuli_and_answers(tmp_path: Path) -> None:
    script("perception.py", "stimuli", "--width-px", "16", "--frames", "1", "--out", "stimuli", folder=tmp_path)
    script("perception.py", "simulate", "stimuli", "--observers", "2", "--out", "answers", folder=tmp_path)
    assert (tmp_path / "answers" / "trials-simulated.parquet").is_file()


@pytest.mark.parametrize(
    ("begin", "hold"),
    [
        ("from analysis.command.ownership import own_folder, release_folders", "own_folder(held, 'out')"),
        (
            "import types, warp; from renderer.compute.device import _one_process\n"
            "warp.config.quiet, warp.config.kernel_cache_dir = True, str(held)",
            "with _one_process(types.ModuleType('empty')):",
        ),
    ],
    ids=("of a folder", "of a compiler"),
)
def test_locks_are_removed_when_they_are_closed(begin: str, hold: str, tmp_path: Path) -> None:
    shown = "print(*(file.suffix or file.name for file in held.iterdir()))"
    held = f"{hold}\n    {shown}" if hold.endswith(":") else f"{hold}\n{shown}\nrelease_folders()"
    done = run("-c", f"from pathlib import Path; held = Path('held')\n{begin}\n{held}\n{shown}", folder=tmp_path)
    assert done.returncode == 0 and done.stdout.split("\n")[0] in (".owner", ".lock"), done.stderr
    assert not list((tmp_path / "held").iterdir())


def test_a_scene_on_another_drive_has_its_whole_path(monkeypatch: pytest.MonkeyPatch) -> None:
    from analysis.live import engine

    assert engine._from(Path("/a/b"), Path("/a/c.xml")) == "../c.xml"

    def relpath(path: Path, start: Path) -> str:
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    monkeypatch.setattr(os.path, "relpath", relpath)
    assert engine._from(Path("/a/b"), Path("/a/c.xml")) == "/a/c.xml"


class Locked(io.BytesIO):
    """A file whose first byte another process has locked, for the first two attempts."""

    def __init__(self, content: bytes) -> None:
        super().__init__(content)
        self.left = 2

    def read(self, size: int | None = -1) -> bytes:
        if self.tell() == 0 and self.left:
            self.left -= 1
            raise PermissionError(13, "Permission denied")
        return super().read(size)


def test_a_journal_is_read_when_its_lock_is_free(monkeypatch: pytest.MonkeyPatch) -> None:
    assert journal._read_past_locks(Locked(b"rows")) == b"rows"
    monkeypatch.setattr(journal, "_LOCKED_S", 0.0)
    with pytest.raises(PermissionError):
        journal._read_past_locks(Locked(b"rows"))


def test_the_owner_of_a_folder_is_read_past_the_locked_byte(tmp_path: Path) -> None:
    with ownership.owned(tmp_path / "lock", "out"):
        content = (tmp_path / "lock").read_bytes()
        assert content.startswith(b" process ") and content.count(b"\n") == 1
        with pytest.raises(ValueError, match=f"in use by process {os.getpid()} on "):
            with ownership.owned(tmp_path / "lock", "out"):
                pass


def test_a_character_that_the_terminal_lacks_ends_nothing(tmp_path: Path) -> None:
    program = "from analysis.command.cli import InputError, run_cli\n"
    program += "def main():\n    print('θ ≤ 1')\n    raise InputError('θ')\nrun_cli(main)"
    done = run("-c", program, folder=tmp_path)
    assert (done.returncode, done.stdout) == (2, "? ? 1\n") and one_line(done.stderr), done.stderr


def test_paths_in_files_have_forward_slashes() -> None:
    assert plain({"out": PureWindowsPath("out\\a b\\c.json")}) == {"out": "out/a b/c.json"}


def test_text_files_have_their_encoding_said() -> None:
    """Text has the code page of the machine otherwise, on Windows."""
    found = []
    for file in (file for package in PACKAGES for file in sorted((ROOT / package).rglob("*.py"))):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and _says_no_encoding(node):
                found.append(f"{file.relative_to(ROOT)}:{node.lineno}")
    assert not found


def _says_no_encoding(call: ast.Call) -> bool:
    named = {one.arg: one.value for one in call.keywords}
    if isinstance(named.get("text"), ast.Constant) and not isinstance(call.func, ast.Name):
        return "encoding" not in named  # of subprocess
    if not isinstance(call.func, ast.Attribute) or "encoding" in named:
        return isinstance(call.func, ast.Name) and call.func.id == "open" and "encoding" not in named
    name = call.func.attr
    if name == "read_text":
        return not call.args
    if name == "write_text":
        return len(call.args) < 2
    modes = [one.value for one in call.args[:1] if isinstance(one, ast.Constant) and isinstance(one.value, str)]
    return name == "open" and any(set(one) <= set("rwax+t") for one in modes)
