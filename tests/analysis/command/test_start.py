"""When a process began, imports without the collector, and the first cycle of a run."""

from __future__ import annotations

import gc
import subprocess
import sys
import time
from pathlib import Path

import pytest

from analysis.command import start
from analysis.command.start import first_imports, first_made, process_began_s

ROOT = Path(__file__).resolve().parents[3]
TICK_S = 0.02


def test_a_process_began_between_its_call_and_its_first_line() -> None:
    program = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r})\nfrom analysis.command.start import *\nprint(process_began_s())"
    )
    called = time.monotonic()
    began = float(subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout)
    assert called - TICK_S <= began <= time.monotonic()


def test_it_stays_when_it_is_asked_later() -> None:
    first, now = process_began_s(), time.monotonic()
    assert first < now and process_began_s() == pytest.approx(first, abs=TICK_S)


def test_it_is_known_where_the_system_keeps_no_such_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    exact = process_began_s()
    monkeypatch.setattr(start, "_STAT", tmp_path / "none")
    assert process_began_s() == pytest.approx(exact, abs=1.5)


@pytest.mark.parametrize("before", [True, False])
def test_the_collector_rests_during_imports_only(before: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "large_package_of_a_test.py").write_text("parts = [[] for _ in range(1000)]\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    collecting = gc.isenabled()
    (gc.enable if before else gc.disable)()
    try:
        with first_imports():
            assert not gc.isenabled()
            import large_package_of_a_test  # type: ignore[import-not-found]  # noqa: F401
        assert gc.isenabled() is before and gc.get_freeze_count() >= 1000
        gc.unfreeze()
        with first_imports():
            pass
        assert gc.get_freeze_count() < 1000, "where nothing was imported nothing is kept"
    finally:
        (gc.enable if collecting else gc.disable)()
        gc.unfreeze()
        sys.modules.pop("large_package_of_a_test", None)


def test_what_was_kept_is_collected_as_the_process_ends() -> None:
    """Also by a library that lists what was not."""
    program = (
        "import atexit, gc, sys\n"
        "atexit.register(lambda: print(gc.get_freeze_count()))\n"
        "from analysis.command.start import first_imports\n"
        "with first_imports():\n    import OpenImageIO\n"
        "print(gc.get_freeze_count() > 1000)"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "0"] and done.stderr == ""


def test_the_collector_comes_back_after_an_error() -> None:
    assert gc.isenabled()
    with pytest.raises(ImportError), first_imports():
        import a_package_that_is_not_there  # type: ignore[import-not-found]  # noqa: F401
    assert gc.isenabled()


def test_only_the_first_cycle_is_made_at_once() -> None:
    made: list[int] = []

    def cycles():
        for number in range(3):
            made.append(number)
            yield number

    lines: list[str] = []
    items, seconds = first_made(cycles(), time.monotonic() - 5.0, lines.append)
    assert made == [0] and 5.0 <= seconds < 60.0
    assert lines == [f"first cycle after {seconds:.2f} s"]
    assert list(items) == made == [0, 1, 2]


def test_a_run_of_no_cycles() -> None:
    items, _ = first_made(iter(()), time.monotonic(), lambda line: None)
    assert list(items) == []
