"""Starting fresh processes: what they say is read, and what fails is named."""

import pytest

from analysis.bench.start import Started, cold_row, first_cycle, start
from analysis.command.cli import InputError


def test_the_time_that_a_run_tells_is_taken() -> None:
    seconds, note = first_cycle(Started(8.0, "bars\nfirst cycle after 2.34 s\nmore"))
    assert seconds == 2.34 and "8.0 s" in note


def test_without_it_the_whole_run_counts() -> None:
    seconds, note = first_cycle(Started(8.0, "nothing of the kind"))
    assert seconds == 8.0 and "whole" in note


def test_a_cold_run_must_say_that_it_compiles() -> None:
    said, silent = Started(9.0, "compiling kernels…"), Started(12.0, "")
    assert cold_row([said, said, said]).note == "says that it compiles"
    row = cold_row([said, silent, Started(10.0, "compiling")])
    assert "NOT" in row.note and row.ours == 10.0 and row.repetitions == 3


def test_help_of_a_script_is_timed() -> None:
    found = start({}, "run.py", "--help")
    assert 0.0 < found.seconds and "--seconds" in found.text


def test_a_process_that_fails_is_named() -> None:
    with pytest.raises(InputError, match=r"run.py nonsense: ended with 2"):
        start({}, "run.py", "nonsense")
