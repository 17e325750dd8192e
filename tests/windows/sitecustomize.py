"""Rules of Windows for a process on Linux, and for the processes that it starts: Python imports this file at its start
wherever its folder is on PYTHONPATH.

It has the rules of files and names that Python's documentation and Microsoft's ("Naming Files, Paths, and Namespaces";
"Moving and Replacing Files"; FlushFileBuffers; LockFileEx) state, as far as the project's own code meets them: names,
letters without case, open files that can neither be replaced nor removed, folders that cannot be opened, files that
must be open for writing to be flushed, ends of lines, and a locked first byte. It lacks what POSIX alone has in Python,
and a terminal's code page has 256 characters. It has neither drives, backslashes, long paths nor another compiler.
"""

from __future__ import annotations

import builtins
import errno
import fcntl
import io
import os
import shutil
import signal
import stat
import sys
import tempfile
from pathlib import Path
from typing import Any

import psutil as psutil  # on Linux it imports the module resource, which is absent below

RESERVED = {"con", "prn", "aux", "nul", *(f"{name}{number}" for name in ("com", "lpt") for number in range(1, 10))}
FORBIDDEN = set('<>:"|?*\\') | {chr(code) for code in range(32)}
ABSENT = {
    os: "fork forkpty killpg getpgid setsid setpgid getloadavg sched_getaffinity sched_setaffinity mkfifo nice",
    signal: "SIGALRM SIGHUP ITIMER_REAL setitimer getitimer pthread_sigmask alarm pause",
}
"""Names of modules of Python that Windows lacks, and that the libraries used here do without."""
CODE_PAGE = "cp1252"
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_fsync, _builtin_open, _io_open, _os_open = os.fsync, builtins.open, io.open, os.open


def fault(path: object, reason: str) -> PermissionError:
    return PermissionError(errno.EACCES, f"Windows: {reason}", os.fsdecode(path))  # type: ignore[arg-type]


def require_name(path: Any) -> None:
    """Names that a file or folder cannot have, and one that differs from a neighbour's in case alone."""
    if isinstance(path, int):
        return
    file = Path(os.fsdecode(path))
    if str(file).startswith(("/proc/", "/dev/", "/sys/")):
        return
    name = file.name
    if FORBIDDEN.intersection(name) or name != name.rstrip(". ") or name.partition(".")[0].lower() in RESERVED:
        raise fault(path, f"no file can be named {name!r}")
    if file.parent.is_dir() and not file.exists():
        same = [other for other in os.listdir(file.parent) if other.casefold() == name.casefold()]
        if same:
            raise fault(path, f"this is the file {same[0]!r}")


def require_closed(path: Any) -> None:
    """A file that this process holds open, or has mapped into its memory, which Python does by a handle of its own,
    keeps its name."""
    wanted = os.path.realpath(os.fsdecode(path))
    if not stat.S_ISREG(os.stat(wanted).st_mode):
        return
    for handle in os.listdir("/proc/self/fd"):
        try:
            if os.readlink(f"/proc/self/fd/{handle}") == wanted:
                raise fault(path, "the file is open")
        except FileNotFoundError:
            continue


def audit(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITES:
        require_name(arguments[0])
    elif event == "os.mkdir":
        require_name(arguments[0])
    elif event == "os.rename":
        require_name(arguments[1])
        for path in arguments[:2]:
            if os.path.exists(path):
                require_closed(path)
    elif event == "os.remove" and arguments[1] == -1 and os.path.exists(arguments[0]):
        require_closed(arguments[0])


def open_as_text(make: Any) -> Any:
    """``open`` whose text has the encoding and the ends of lines of Windows where nothing else is said."""

    def opened(
        file: Any, mode: str = "r", buffering: int = -1, encoding: str | None = None, errors: str | None = None,
        newline: str | None = None, *rest: Any, **named: Any,
    ) -> Any:  # fmt: skip
        if "b" not in mode:
            encoding = CODE_PAGE if encoding in (None, "locale") else encoding
            newline = "\r\n" if newline is None and set("wax+").intersection(mode) else newline
        return make(file, mode, buffering, encoding, errors, newline, *rest, **named)

    return opened


def opened_file(path: Any, flags: int, *rest: Any, **named: Any) -> int:
    if not named and not isinstance(path, int) and os.path.isdir(path):
        raise fault(path, "a folder cannot be opened")
    return _os_open(path, flags, *rest, **named)


def flushed(handle: Any) -> None:
    number = handle if isinstance(handle, int) else handle.fileno()
    if fcntl.fcntl(number, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY:
        raise OSError(errno.EBADF, "Windows: a file that is open for reading cannot be flushed")
    _fsync(handle)


def rename_to_new(source: Any, target: Any, **named: Any) -> None:
    if os.path.exists(target):
        raise FileExistsError(errno.EEXIST, "Windows: rename replaces nothing", os.fsdecode(target))
    os.replace(source, target, **named)


def begin() -> None:
    for module, names in ABSENT.items():
        for name in names.split():
            if hasattr(module, name):
                delattr(module, name)
    sys.modules["resource"] = None  # type: ignore[assignment]
    builtins.open, io.open = open_as_text(_builtin_open), open_as_text(_io_open)
    os.open, os.fsync, os.rename = opened_file, flushed, rename_to_new
    os.linesep = "\r\n"
    shutil._use_fd_functions = False  # type: ignore[attr-defined]
    tempfile.TemporaryFile = tempfile.NamedTemporaryFile  # type: ignore[assignment,misc]
    sys.addaudithook(audit)


begin()
