"""Shared by all command lines: one clear line for bad input, and a clean end on Ctrl-C."""

from __future__ import annotations

import atexit
import contextlib
import errno
import importlib.util
import io
import os
import re
import select
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NoReturn, TypeVar

from analysis.command.interrupts import heeded
from analysis.command.ownership import release_folders
from tsar.memory import free_memory_bytes

Options = TypeVar("Options")

EXIT_BAD_INPUT = 2
EXIT_BROKEN = 3
EXIT_INTERRUPTED = 130
EXIT_UNREAD = 141  # 128 + SIGPIPE, as shells report it

_SPINNING = ("GOMP_SPINCOUNT", "OMP_WAIT_POLICY")
_SPINS = "1000"  # no difference was measured from 300 to 3000 cycles
_NO_MEMORY = re.compile(
    r"can't allocate memory|[Cc]annot allocate memory|bad_alloc|[Ff]ailed to allocate|can't start new thread"
    r"|out of memory|failed to map segment"
)


class InputError(ValueError):
    """Bad input; the message says what was expected, what arrived, and where."""


class BrokenInvariants(RuntimeError):
    """Runs of the adaptive pipeline broke an invariant, so their results cannot be relied on."""


def require_unbroken(broken: Sequence[str]) -> None:
    """Raises BrokenInvariants unless the list of runs that broke an invariant is empty."""
    if broken:
        raise BrokenInvariants(f"invariants are broken in {len(broken)} runs: {', '.join(broken)}")


@contextlib.contextmanager
def bad_input() -> Iterator[None]:
    """Marks a block in which a ValueError, an OSError or a lack of memory is caused by the input."""
    try:
        yield
    except InputError:
        raise
    except (MemoryError, RuntimeError) as error:
        lack = _lack_of_memory(error)
        if lack is None:
            raise
        raise lack from error
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        raise _lack_of_memory(error) or InputError(f"{where}{error.strerror or error}") from error
    except ValueError as error:
        raise InputError(str(error) or type(error).__name__) from error


def _lack_of_memory(error: BaseException) -> InputError | None:
    """The error to report if memory ran out; None for any other error."""
    text = " ".join(str(error).split())
    if not any(map(_tells_of_memory, _with_causes(error))):
        return None
    free = free_memory_bytes() / 2**30
    return InputError(f"out of memory ({text or type(error).__name__}); {free:.1f} GiB are free now: ask for less")


def _with_causes(error: BaseException | None) -> Iterator[BaseException]:
    """An error, and the chain of its causes."""
    while error is not None:
        yield error
        error = error.__cause__


def _tells_of_memory(error: BaseException) -> bool:
    if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM):
        return True
    return isinstance(error, (RuntimeError, OSError, ImportError)) and bool(_NO_MEMORY.search(str(error)))


@contextlib.contextmanager
def full_disk(folder: Path, *writer_errors: type[Exception]) -> Iterator[None]:
    """Marks a block in which an OSError, or an error of a file writer, means that results cannot be written to
    ``folder``, such as to a full disk."""
    try:
        yield
    except writer_errors as error:
        raise InputError(str(error)) from error
    except OSError as error:
        reason = f"{error.filename or folder}: cannot be written ({error.strerror or error})"
        raise _lack_of_memory(error) or InputError(reason) from error


def parse(options: type[Options], description: str, arguments: list[str] | None = None) -> Options:
    """Options from the command line; help goes to standard output.

    Raises:
        InputError: an option cannot be parsed or is out of range.
    """
    import tyro

    from analysis.command.messages import as_typed, one_line
    from analysis.command.subjects import SET, by_subject, renamed, unknown

    caught, given = io.StringIO(), sys.argv[1:] if arguments is None else arguments
    asked = bool({"-h", "--help"}.intersection(given))
    shown = by_subject(options) if asked else options
    try:
        with contextlib.redirect_stderr(caught), bad_input():
            return tyro.cli(shown, description=_as_called(description), args=given, registry=SET if asked else None)
    except InputError as error:
        raise InputError(as_typed(str(error), given)) from error.__cause__
    except SystemExit as stop:
        if not stop.code:
            raise
        line = renamed(options, given) or unknown(options, given)
        raise InputError(line or as_typed(one_line(caught.getvalue(), given), given)) from None


def _as_called(description: str) -> str:
    """A description whose examples call the command in the way it was called: as a script, or by ``tsar``."""
    if not sys.argv[0].startswith("tsar "):
        return description
    return re.sub(r"python scripts/(\w+)\.py", sys.argv[0], description)


def require_files(*files: Path) -> None:
    """Raises InputError unless all files can be opened; for commands whose libraries take long to load."""
    for file in files:
        try:
            file.open("rb").close()
        except OSError as error:
            raise InputError(f"{file}: cannot be read ({error.strerror or error})") from None


def require_memory(need_bytes: float, what: str) -> None:
    """Raises InputError if less memory is free than ``what`` needs."""
    have = free_memory_bytes()
    if need_bytes > have:
        raise InputError(f"{what} needs about {need_bytes / 2**30:.1f} GiB of memory, {have / 2**30:.1f} GiB are free")


def run_cli(main: Callable[[], None]) -> None:
    """Runs a script's main function and ends the process.

    Bad input, and a package that is missing or of an unsupported version, end with one line on standard
    error and status 2, broken invariants with one line and status 3, Ctrl-C with one line and status 130. Where nothing
    reads standard output any more, as after ``| head``, the process ends without a line and with status 141.
    """
    _spin_briefly()
    _open_streams()
    warnings.showwarning = _one_warning
    try:
        with heeded():
            main()
            sys.stdout.flush()
    except (InputError, BrokenPipeError) as error:
        if any(isinstance(cause, BrokenPipeError) for cause in _with_causes(error)) and _unread():
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing reads what is left
            sys.exit(EXIT_UNREAD)
        if isinstance(error, BrokenPipeError):
            raise
        _end(error, EXIT_BAD_INPUT)
    except BrokenInvariants as error:
        _end(error, EXIT_BROKEN)
    except ModuleNotFoundError as error:
        from analysis.command.extras import extra_of

        missing = extra_of(error) or _base_of(error)
        if missing is None:
            raise
        _end(missing, EXIT_BAD_INPUT)
    except ImportError as error:
        _end(_lack_of_memory(error) or error, EXIT_BAD_INPUT)
    except (MemoryError, RuntimeError, OSError) as error:
        lack = _lack_of_memory(error)
        if lack is None:
            raise
        _end(lack, EXIT_BAD_INPUT)
    except KeyboardInterrupt:
        print("interrupted; unfinished files were removed, a reference continues where it stopped", file=sys.stderr)
        sys.exit(EXIT_INTERRUPTED)
    finally:
        release_folders()


def run_process(main: Callable[[], None]) -> None:
    """Runs :func:`run_cli` as the last action of this process.

    The process ends as soon as its exit functions have run: the interpreter's last garbage collection took up to a
    minute in a study, and libraries print lists of live objects in it.
    """
    code: int | str | None = 0
    try:
        run_cli(main)
    except SystemExit as stop:
        code = stop.code
        if isinstance(code, str):
            raise
    if not code:
        threading._shutdown()  # type: ignore[attr-defined]  # waits for threads, as at any end
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(BrokenPipeError):
            stream.flush()
    os._exit(code or 0)


def _base_of(error: ModuleNotFoundError) -> InputError | None:
    """The error to report if a package is not installed for this Python; None for a module within one that is."""
    name = (error.name or "").partition(".")[0]
    if not name or name in sys.stdlib_module_names or importlib.util.find_spec(name):
        return None
    return InputError(
        f"expected the package {name}, found none for {sys.executable}; activate the environment in which this version "
        "is installed (in a checkout: make demo, then . .venv/bin/activate)"
    )


def _end(error: Exception, status: int) -> NoReturn:
    message = re.sub(r"\s+", " ", str(error)).strip()
    print(f"error: {message}", file=sys.stderr)
    sys.exit(status)


def _one_warning(message: Warning | str, *_: object) -> None:
    """Prints a warning in one line, without its location in the code."""
    text = re.sub(r"\s+", " ", str(message)).strip()
    print(f"warning: {text}", file=sys.stderr)


def _unread() -> bool:
    """Whether nothing reads standard output any more; assumed where the system has no poll, as on Windows."""
    if not hasattr(select, "poll"):
        return True
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)  # errors are told unasked
    return bool(poll.poll(0))


def _open_streams() -> None:
    """Gives the streams that the shell has closed a place to write to. All print a question mark for a character that
    their encoding lacks, as code pages of Windows do."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))
        if isinstance(stream := getattr(sys, name), io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def _spin_briefly() -> None:
    """Makes torch's idle threads sleep soon, unless the user has set that.

    By default they spin for milliseconds after every operation, on cores that then trace rays. If another process is
    busy too, operations wait for threads that wait for a core. This has an effect only before torch is imported.
    """
    if not any(name in os.environ for name in _SPINNING):
        os.environ[_SPINNING[0]] = _SPINS
