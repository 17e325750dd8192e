"""Bad input ends with one plain line that names the field, and with the right exit status."""

from __future__ import annotations

import contextlib
import errno
import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from analysis.command import cli
from analysis.command.cli import InputError, bad_input, full_disk, parse, require_memory, run_cli
from analysis.command.options import Unprefixed
from tsar.config import TsarConfig


@dataclass(frozen=True)
class Options:
    """Like those of a script."""

    count: int = 3
    """How many."""
    place: Path = Path("a")
    """Where."""
    tsar: TsarConfig = field(default_factory=TsarConfig)
    """What."""
    shares: tuple[float, ...] = ()
    """Which."""
    corner: tuple[float, float] = (0.0, 0.0)
    """Where from."""
    only: int | None = None
    """Which alone."""
    kind: Literal["dwt", "fft"] = "dwt"
    """How."""

    def __post_init__(self) -> None:
        if self.count < 0:
            raise ValueError(f"count: expected at least 0,\n got {self.count}")


@dataclass(frozen=True)
class Flat:
    """Like a script whose options have no prefix."""

    tsar: Unprefixed[TsarConfig] = field(default_factory=TsarConfig)


def test_options_are_parsed() -> None:
    found = parse(Options, "d", ["--count", "7", "--place", "b/c", "--tsar.batch-size", "64"])
    assert found == Options(7, Path("b/c"), TsarConfig(batch_size=64))
    assert parse(Options, "d", []) == Options()


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--nope", "3"], ["expected an option of this command, got --nope"]),
        (["--coumt=3", "--shars", "1"], ["expected an option of this command, got --coumt (nearest: --count)"]),
        (["-x"], ["expected an option of this command, got -x"]),
        (["--count"], ["--count"]),
        (["stray"], ["expected no further argument, got 'stray'"]),
        (["--count", "-1"], ["count: expected at least 0", "got -1"]),
        (["--tsar.batch-size", "-3"], ["batch_size: expected between 1 and 8192 framelets, got -3"]),
        (["--tsar.tiling.level-max", "9"], ["tiling.level_max: expected between 2 and 7, got 9"]),
        (["--tsar.error.norm", "l3"], ["error.norm", "l3", "linf"]),
        (["--count", "1.5"], ["--count: expected a whole number, got '1.5'"]),
        (["--shares", "1", "x", "--count", "2"], ["--shares: expected numbers, got '1', 'x'"]),
        (["--corner", "1", "x"], ["--corner: expected 2 numbers, got '1', 'x'"]),
        (["--corner=1"], ["--corner: expected 2 values, got '1'"]),
        (["--kind"], ["--kind: expected a value, got none"]),
        (["--only", "x"], ["--only: expected a whole number, got 'x'"]),
        (["--kind", "fft2"], ["--kind: expected one of dwt, fft, got 'fft2' (nearest: fft)"]),
    ],
)
def test_bad_arguments_name_what_is_wrong_in_one_line(
    arguments: list[str], parts: list[str], capsys: pytest.CaptureFixture
) -> None:
    with pytest.raises(InputError) as caught:
        parse(Options, "d", arguments)
    message = str(caught.value)
    assert all(part in message for part in parts), message
    assert not set(message) & set("╭╮╰╯│─") and "full helptext" not in message
    assert capsys.readouterr() == ("", ""), "nothing is printed on the way"

    with pytest.raises(SystemExit) as stop:
        run_cli(lambda: parse(Options, "d", arguments))
    printed = capsys.readouterr()
    assert stop.value.code == 2 and printed.out == ""
    assert printed.err.startswith("error: ") and printed.err.endswith("\n") and printed.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--rate-max=3"], "rate_max: expected 1, 2, 4 or 8, or 0, got 3"),
        (["--bias", "9"], "bias: expected a number in [-8, 8], got 9.0"),
    ],
)
def test_a_field_of_a_record_has_the_name_of_its_option(arguments: list[str], message: str) -> None:
    with pytest.raises(InputError) as caught:
        parse(Flat, "d", arguments)
    assert str(caught.value) == message


def test_help_goes_to_standard_output(capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as stop:
        parse(Options, "what it does", ["--help"])
    printed = capsys.readouterr()
    assert not stop.value.code and printed.err == ""
    assert "what it does" in printed.out and "--tsar.batch-size" in printed.out and "How many." in printed.out


def raising(error: BaseException) -> Callable[[], None]:
    def main() -> None:
        raise error

    return main


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (InputError("a: expected b,\n   got\tc"), 2, "error: a: expected b, got c\n"),
        (KeyboardInterrupt(), 130, None),
    ],
)
def test_run_cli_ends_with_one_line(error, status: int, line: str | None, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as stop:
        run_cli(raising(error))
    printed = capsys.readouterr()
    assert stop.value.code == status and printed.out == ""
    assert printed.err.count("\n") == 1 and (printed.err == line or (line is None and "interrupted" in printed.err))


def ended(*arguments: str, read: bool = True) -> tuple[int, str]:
    """Status and standard error of a Python process. Its output waits in memory, as usual in pipes; without ``read``
    the reader has left."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    reader, writer = os.pipe()
    with contextlib.ExitStack() as held:
        held.callback(os.close, writer)
        held.callback(os.close, reader) if read else os.close(reader)
        command, root = [sys.executable, *arguments], Path(__file__).parents[3]
        done = subprocess.run(command, cwd=root, env=environment, stdout=writer, stderr=subprocess.PIPE, text=True)
    return done.returncode, done.stderr


def doing(action: str) -> tuple[str, str]:
    program = "from analysis.command.cli import InputError, run_process\n"
    return "-c", f"{program}def main():\n    {action}\nrun_process(main)"


def test_a_reader_that_leaves_early_ends_the_command_without_a_line() -> None:
    assert ended("scripts/run.py", "--help", read=False) == (141, "")
    assert ended(*doing("print(1)"), read=False) == (141, "")
    assert ended(*doing("print(1); raise InputError('bad')"), read=False) == (2, "error: bad\n")


def test_another_pipe_that_breaks_is_no_reader_that_left() -> None:
    action = "import socket; ends = socket.socketpair(); ends[1].close(); print(1); ends[0].send(b'x')"
    status, line = ended(*doing(action))
    assert status == 1 and line.endswith("BrokenPipeError: [Errno 32] Broken pipe\n")


@pytest.mark.parametrize(
    ("action", "status", "line"),
    [("print(1)", 0, ""), ("parse(RunOptions, '', ['-h'])", 0, ""), ("raise InputError('bad')", 2, "error: bad\n")],
)
def test_no_standard_output_is_no_fault(action: str, status: int, line: str) -> None:
    """As after ``>&-``, where Python starts with None for it."""
    program = "import sys; sys.stdout = None\nfrom analysis.command.cli import InputError, parse, run_process\n"
    program += "from analysis.comparison.options import RunOptions\n"
    assert ended("-c", f"{program}def main():\n    {action}\nrun_process(main)") == (status, line)


def test_run_cli_hides_neither_success_nor_faults_of_the_program() -> None:
    done = []
    run_cli(lambda: done.append(1))
    assert done == [1]
    with pytest.raises(ValueError, match="a fault"):
        run_cli(raising(ValueError("a fault")))


def test_idle_threads_spin_briefly_unless_told_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("GOMP_SPINCOUNT", "OMP_WAIT_POLICY")
    for name in names:
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    found: list[tuple[str | None, ...]] = []

    def main() -> None:
        found.append(tuple(os.environ.get(name) for name in names))

    run_cli(main)
    monkeypatch.setenv("GOMP_SPINCOUNT", "7")
    run_cli(main)
    monkeypatch.delenv("GOMP_SPINCOUNT")
    monkeypatch.setenv("OMP_WAIT_POLICY", "active")
    run_cli(main)
    brief = found[0][0]
    assert brief is not None and 0 < int(brief) < 100_000
    assert found == [(brief, None), ("7", None), (None, "active")]


def test_the_spinning_is_settled_before_torch_is_imported() -> None:
    """The library reads it once; a script that imports torch at its top would come too late."""
    answer = "print('torch' in sys.modules, 'GOMP_SPINCOUNT' in os.environ)"
    program = f"import os, sys, analysis.command.cli as c\nc.run_cli(lambda: {answer})"
    environment = {
        name: value for name, value in os.environ.items() if name not in ("GOMP_SPINCOUNT", "OMP_WAIT_POLICY")
    }
    root = Path(__file__).resolve().parents[3]
    done = subprocess.run([sys.executable, "-c", program], cwd=root, env=environment, capture_output=True, text=True)
    assert done.stdout.split() == ["False", "True"], done.stderr


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (ValueError("side: got 3"), "side: got 3"),
        (ValueError(), "ValueError"),
        (InputError("as it is"), "as it is"),
        (FileNotFoundError(errno.ENOENT, "No such file or directory", "a/b.obj"), "a/b.obj: No such file or directory"),
        (OSError("plain"), "plain"),
    ],
)
def test_bad_input_turns_faults_of_the_input_into_one_kind(error: Exception, message: str) -> None:
    with pytest.raises(InputError) as caught, bad_input():
        raise error
    assert str(caught.value) == message


def test_bad_input_lets_other_faults_through() -> None:
    with pytest.raises(KeyError), bad_input():
        raise KeyError("a")


def of_a_library() -> Exception:
    """As Warp reports it if there is no memory for its libraries."""
    error = RuntimeError("Failed to load the shared library 'warp.so'")
    error.__cause__ = OSError("warp.so: failed to map segment from shared object")
    return error


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        RuntimeError("[enforce fail at alloc_cpu.cpp:132] DefaultCPUAllocator: can't allocate memory: you tried to"),
        RuntimeError("Failed to allocate 123 bytes on device 'cpu'"),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        ImportError("libtorch_cpu.so: failed to map segment from shared object"),
        of_a_library(),
    ],
)
def test_a_lack_of_memory_is_one_line(error: Exception, capsys: pytest.CaptureFixture) -> None:
    def main() -> None:
        raise error

    def marked(block) -> None:
        with block:
            raise error

    for failing in (main, lambda: marked(bad_input()), lambda: marked(full_disk(Path("x")))):
        with pytest.raises(SystemExit) as stop:
            run_cli(failing)
        said = capsys.readouterr().err
        assert stop.value.code == 2 and said.startswith("error: out of memory (") and said.count("\n") == 1


def test_other_faults_of_a_run_are_not_a_lack_of_memory() -> None:
    for error in (RuntimeError("shape"), OSError(errno.EIO, "I/O error")):
        with pytest.raises(type(error)), bad_input() if isinstance(error, RuntimeError) else nullcontext():
            raise error


def test_require_memory_says_what_is_needed_and_what_is_free(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli, "free_memory_bytes", lambda: 2 * 2**30)
    require_memory(2.0 * 2**30, "x")
    with pytest.raises(InputError, match=r"^resolution_px: 99 needs about 2\.5 GiB of memory, 2\.0 GiB are free$"):
        require_memory(2.5 * 2**30, "resolution_px: 99")


def test_a_command_under_a_limit_of_memory_ends_with_one_line(tmp_path: Path) -> None:
    """Free memory is that of the process's limit, not of the machine."""
    program = "import analysis.command.cli as c\nimport numpy as np\nc.run_cli(lambda: {body})"
    root = Path(__file__).resolve().parents[3]
    bodies = ("c.require_memory(3e9, 'pictures')", "np.ones(400_000_000)")
    for body, part in zip(bodies, ("pictures needs about 2.8 GiB of memory", "out of memory"), strict=True):
        command = f'ulimit -v 2000000; exec "{sys.executable}" -c "{program.format(body=body)}"'
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(["bash", "-c", command], cwd=root, env=environment, capture_output=True, text=True)
        assert done.returncode == 2 and part in done.stderr and done.stderr.count("\n") == 1, done.stderr
