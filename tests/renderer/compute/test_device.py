"""Loading kernels: once each, side by side, with a word on how far it is where it takes long."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import threading
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
import warp as wp

from renderer.compute import device

ROOT = Path(__file__).resolve().parents[3]
SHARED = """import warp as wp

@wp.func
def shared(x: float):
    return 2.0 * x + 1.0
"""
KERNEL = """import warp as wp
from both import shared

@wp.kernel(enable_backward=False)
def {name}(out: wp.array(dtype=float)):
    out[wp.tid()] = shared(float(wp.tid())) + {add}
"""
COLD = """
import sys
sys.path[:0] = [{root!r}, {folder!r}]
from renderer.compute import device
import warp as wp, first, second
device._SLOW_LOAD_S = 0.0
device.load_kernels((first, second), "cpu")
for kernel in (first.first, second.second):
    out = wp.zeros(3, dtype=float, device="cpu")
    wp.launch(kernel, dim=3, inputs=[out], device="cpu")
    print(out.numpy().tolist())
"""


class Loads:
    """Stands in for Warp: a load ends when it is let go."""

    def __init__(self, *held: str) -> None:
        self.names: list[str] = []
        self.gates = {name: threading.Event() for name in held}
        self.broken: set[str] = set()

    def __call__(self, module: ModuleType, device: str) -> None:
        self.names.append(module.__name__)
        if module.__name__ in self.gates:
            assert self.gates[module.__name__].wait(60.0)
        if module.__name__ in self.broken:
            raise RuntimeError(f"{module.__name__} does not compile")

    def after(self, name: str, word: str, write: Callable[[str], int]) -> Callable[[str], int]:
        """Writes, and lets a module go once a text with a word has been written."""

        def written(text: str) -> int:
            count = write(text)
            if word in text:
                self.gates[name].set()
            return count

        return written

    def letting_go(self, lines: list[str]) -> Callable[[str], None]:
        """Keeps lines; each line lets the next module in order go."""
        order = iter(self.gates.values())

        def report(line: str) -> None:
            lines.append(line)
            next(order, threading.Event()).set()

        return report


@pytest.fixture
def loads(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Loads]:
    """Makes a stand-in that is in force, with nothing loaded yet and lines that follow closely."""

    def make(*held: str, slow_s: float = 0.0) -> Loads:
        made = Loads(*held)
        monkeypatch.setattr(device.wp, "load_module", made)
        monkeypatch.setattr(device, "_loaded", set())
        monkeypatch.setattr(device, "_SLOW_LOAD_S", slow_s)
        monkeypatch.setattr(device, "_LINE_INTERVAL_S", 0.01)
        monkeypatch.setattr(device, "_STATUS_INTERVAL_S", 0.01)
        monkeypatch.setattr(device, "core_count", lambda: 2)
        return made

    return make


A, B, C = (ModuleType(name) for name in ("kernels.a", "kernels.b", "kernels.c"))


def test_modules_load_once_each_device(loads) -> None:
    made = loads(slow_s=60.0)
    device.load_kernels(A, "cpu")
    device.load_kernels([A, B], "cpu")
    device.load_kernels((B, A), "cpu")
    assert made.names == ["kernels.a", "kernels.b"]
    device.load_kernels(B, "cuda:0")
    assert made.names == ["kernels.a", "kernels.b", "kernels.b"]


def test_what_is_expected_loads_beside_the_next(loads) -> None:
    made = loads(slow_s=60.0)
    device.expect_kernels([B, A], "cpu")
    device.load_kernels(C, "cuda:0")
    assert made.names == ["kernels.c"]
    device.load_kernels(A, "cpu")
    assert sorted(made.names) == ["kernels.a", "kernels.b", "kernels.c"]
    device.load_kernels(C, "cpu")
    assert made.names[3:] == ["kernels.c"]


def test_what_is_quick_is_not_talked_about(loads, capsys: pytest.CaptureFixture) -> None:
    loads(slow_s=60.0)
    lines: list[str] = []
    device.load_kernels([A, B], "cpu", lines.append)
    device.load_kernels(C, "cpu")
    assert lines == [] and capsys.readouterr() == ("", "")


def test_lines_tell_what_is_ready_and_what_is_to_come(loads) -> None:
    made = loads("kernels.a", "kernels.b", "kernels.c")
    lines: list[str] = []
    device.load_kernels([A, B, C], "cpu", made.letting_go(lines))
    assert lines[0].startswith("compiling kernels for cpu") and "0 of 3 modules ready, 0 s" in lines[0]
    assert lines[0].endswith("to come: kernels.a, kernels.b, kernels.c")
    ready = [int(line.split(" of 3 ")[0].rsplit(" ", 1)[1]) for line in lines[:-1]]
    assert ready == sorted(ready)
    assert all("kernels.a" not in line for line, count in zip(lines, ready, strict=False) if count)
    assert lines[-1].startswith("kernels for cpu ready after ")


def test_lines_go_on_while_one_module_compiles(loads) -> None:
    made = loads("kernels.a")
    lines: list[str] = []

    def report(line: str) -> None:
        lines.append(line)
        if len(lines) == 4:
            made.gates["kernels.a"].set()

    device.load_kernels(A, "cpu", report)
    assert len(lines) >= 5 and all("0 of 1 modules ready" in line for line in lines[:4])


def test_modules_load_side_by_side(loads, monkeypatch: pytest.MonkeyPatch) -> None:
    loads()
    both = threading.Barrier(2)
    monkeypatch.setattr(device.wp, "load_module", lambda module, device: both.wait(60.0))
    device.load_kernels([A, B], "cpu", lambda line: None)


def test_a_module_that_fails_says_so_and_is_tried_again(loads) -> None:
    made = loads("kernels.b")
    made.broken.add("kernels.b")
    lines: list[str] = []
    with pytest.raises(RuntimeError, match=r"kernels\.b does not compile"):
        device.load_kernels([A, B, C], "cpu", made.letting_go(lines))
    assert lines and not any(line.startswith("kernels for cpu ready") for line in lines)
    made.broken.clear()
    made.names.clear()
    device.load_kernels([A, B], "cpu")
    assert "kernels.b" in made.names and "kernels.a" not in made.names


def test_lines_go_to_standard_error(loads, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also on a terminal where something else, such as a bar, has taken the stream's place."""
    made = loads("kernels.a")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(sys.stderr, "write", made.after("kernels.a", "compiling", sys.stderr.write))
    device.load_kernels(A, "cpu")
    shown = capsys.readouterr()
    lines = shown.err.splitlines()
    assert shown.out == "" and len(lines) >= 2 and "\x1b" not in shown.err
    assert "compiling" in lines[0] and "ready after" in lines[-1]


def test_a_terminal_shows_a_status_that_goes_away(loads, monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    made, terminal = loads("kernels.a"), Terminal()
    monkeypatch.setattr(terminal, "write", made.after("kernels.a", "compiling", terminal.write))
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(sys, "__stderr__", terminal)
    device.load_kernels(A, "cpu")
    written = terminal.getvalue()
    assert "compiling kernels for cpu" in written and "kernels.a" in written
    assert "\x1b[2K" in written.rpartition("compiling")[2], "the line is taken back"


def test_modules_that_share_a_function_compile_side_by_side(tmp_path: Path) -> None:
    """With nothing in the cache, in a process of its own."""
    (tmp_path / "both.py").write_text(SHARED)
    for name, add in (("first", 10.0), ("second", 20.0)):
        (tmp_path / f"{name}.py").write_text(KERNEL.format(name=name, add=add))
    program = COLD.format(root=str(ROOT), folder=str(tmp_path))
    environment = {**os.environ, "WARP_CACHE_PATH": str(tmp_path / "cache")}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["[11.0, 13.0, 15.0]", "[21.0, 23.0, 25.0]"]
    assert "0 of 2 modules ready" in done.stderr and "to come: first, second" in done.stderr


@pytest.mark.parametrize("found", ["1.18.1", "1.20.0", "1.190.0", "2.0.0", "0.0"])
def test_a_version_of_warp_that_was_not_tested_is_refused(found: str) -> None:
    with pytest.raises(ImportError, match=rf"^warp-lang: expected version 1\.19\.x, which was tested, found {found}$"):
        device.require_tested(found)


def test_the_installed_version_is_the_one_asked_for() -> None:
    """The range of the package's metadata is the one that is checked."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (warp,) = (line for line in project["dependencies"] if line.startswith("warp-lang"))
    major, minor = map(int, device.WARP_TESTED.split("."))
    assert warp == f"warp-lang>={major}.{minor},<{major}.{minor + 1}"
    device.require_tested(wp.__version__)


def test_a_command_says_in_one_line_that_the_version_is_wrong(tmp_path: Path) -> None:
    """The version is asked for before anything of the package is used."""
    (tmp_path / "warp.py").write_text("__version__ = '1.7.2'\n")
    command = [sys.executable, str(ROOT / "scripts/run.py"), "fly-by", "--out", str(tmp_path / "out")]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: warp-lang: expected version 1.19.x, which was tested, found 1.7.2\n"
