"""The command of the live view: where its page is, what it refuses, and the rates that it measures."""

from __future__ import annotations

import re
import threading
import urllib.request
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.command.cli import InputError
from analysis.live.bench import SIZES, cycle_rates, driven
from analysis.live.options import NOTHING
from analysis.live.run import watched
from tests.analysis.live.builders import options, until


def test_it_says_where_its_page_is_and_ends_when_told(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    over, said = threading.Event(), []
    thread = threading.Thread(target=watched, args=(options(out=tmp_path), over))
    thread.start()
    try:
        until(lambda: said.append(capsys.readouterr().out) or "live view of chase" in "".join(said))
        address = re.findall(r"http://127\.0\.0\.1:\d+/", "".join(said))[0]
        assert b"<h1>chase</h1>" in urllib.request.urlopen(address).read()
        port = int(address.rstrip("/").rpartition(":")[2])
        with pytest.raises(InputError, match=f"port: expected a free one, got {port}"):
            watched(replace(options(out=tmp_path), port=port))
    finally:
        over.set()
        thread.join()
    with pytest.raises(OSError):
        urllib.request.urlopen(address)


def test_rates_are_of_each_run(tmp_path: Path) -> None:
    given = replace(options(), bench_seconds=0.2)
    both = driven(given, 64, ("framed", "tsar"))
    assert [(one.policy, one.beside) for one in both] == [("framed", "tsar"), ("tsar", "framed")]
    (alone,) = driven(given, 64, ("framed", NOTHING))
    for one in (*both, alone):
        assert one.resolution_px == 64 and one.wall_s >= 0.2 and one.cpu_s > 0.0
        assert (one.cycles > 0) == (one.own_s > 0.0)
    assert alone.policy == "framed" and alone.beside == ""


def test_rates_of_no_policy_are_refused() -> None:
    with pytest.raises(InputError, match="left, right: expected a policy"):
        cycle_rates(options(left=NOTHING, right=NOTHING))


def test_the_table_has_every_size_alone_and_together(monkeypatch: pytest.MonkeyPatch) -> None:
    from analysis.live import bench

    asked = []

    def pretend(given: object, side: int, pair: tuple[str, ...]) -> list[bench.Rate]:
        asked.append((side, pair))
        names = [name for name in pair if name != NOTHING]
        return [bench.Rate(side, name, names[0] if len(names) > 1 else "", 100, 2.0, 1.0, 0.5) for name in names]

    monkeypatch.setattr(bench, "driven", pretend)
    table, said = cycle_rates(options())
    assert len(asked) == 3 * len(SIZES) and len(table.rows) == 4 * len(SIZES)  # type: ignore[union-attr]
    assert table.rows[0] == ("256", "framed", "–", "50.0", "10.0", "5.0", "0.25")  # type: ignore[union-attr]
    assert "cores" in said and "batch 16" in said  # type: ignore[operator]


def test_a_policy_that_stops_is_said_in_the_table_of_rates(monkeypatch: pytest.MonkeyPatch) -> None:
    from analysis.live import bench

    stopped = bench.Rate(64, "framed", "", 0, 2.0, 0.0, 0.5, "out of memory")
    monkeypatch.setattr(bench, "driven", lambda *_: [stopped])
    table, _ = cycle_rates(options())
    assert not isinstance(table, str)
    assert table.rows[0] == ("64", "framed", "–", "failed: out of memory", "–", "–", "–")
