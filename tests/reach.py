"""A plugin of pytest that notes the functions of the project that each test calls, and its seconds."""

from __future__ import annotations

import inspect
import json
import sys
import threading
import time
from collections.abc import Generator
from pathlib import Path
from types import FrameType

import pytest

EVERYTHING = "*:"
"""Stands for all functions: those of a test that starts another process are not seen."""
_current: Noted | None = None


class Noted:
    """The plugin. What runs in set-up and tear-down counts for every test of the run, as fixtures are shared.

    Args:
        root: folder of the checkout; only its files are noted.
        result: file for the result, ``{"shared": places, "tests": {test: [seconds, places]}}``. A place is a file and
            the qualified name of a function, ``tsar/morton.py:interleave``.
    """

    def __init__(self, root: Path, result: Path) -> None:
        global _current
        self.prefix, self.result = f"{root}/", result
        self.shared, self.tests = set[str](), dict[str, tuple[float, list[str]]]()
        self.seen = set[tuple[str, str]]()
        if _current is None:
            sys.addaudithook(_processes)
        _current = self
        self.noted()

    def traced(self, frame: FrameType, event: str, argument: object) -> None:
        """Called at each call of a function; asks for no events inside it. Modules and classes are no functions."""
        if frame.f_code.co_flags & inspect.CO_OPTIMIZED:
            self.seen.add((frame.f_code.co_filename, frame.f_code.co_qualname))

    def noted(self) -> set[str]:
        """The functions since the last time."""
        sys.settrace(None)
        threading.settrace(None)  # type: ignore[arg-type]
        own = self.prefix, EVERYTHING[0]
        found = {f"{file.removeprefix(self.prefix)}:{name}" for file, name in self.seen if file.startswith(own)}
        self.seen = set()
        threading.settrace(self.traced)
        sys.settrace(self.traced)
        return found

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Generator[None, object, object]:
        self.shared |= self.noted()
        began = time.thread_time()
        try:
            return (yield)
        finally:
            self.tests[item.nodeid] = time.thread_time() - began, sorted(self.noted())

    def pytest_sessionfinish(self) -> None:
        self.shared |= self.noted()
        sys.settrace(None)
        threading.settrace(None)  # type: ignore[arg-type]
        self.result.write_text(json.dumps({"shared": sorted(self.shared), "tests": self.tests}))


def _processes(event: str, arguments: tuple) -> None:
    if event in ("subprocess.Popen", "os.fork", "os.posix_spawn") and _current is not None:
        _current.seen.add((EVERYTHING[0], ""))


class Chosen:
    """A plugin that runs some tests alone."""

    def __init__(self, tests: set[str]) -> None:
        self.tests = tests

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = [item for item in items if item.nodeid in self.tests]
