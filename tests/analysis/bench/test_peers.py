"""What the benchmark says about peers that it lacks."""

import inspect
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from analysis.bench import embree, mitsuba, peers, run
from analysis.bench.options import GROUPS, BenchOptions
from analysis.bench.peers import WANTED_BY, missing_peers
from analysis.bench.rows import Row
from analysis.command.progress import Bars


def test_every_group_that_asks_a_peer_is_listed() -> None:
    uses = {"embreex": "analysis.bench.embree", "mitsuba": "from analysis.bench import mitsuba", "pywt": "import pywt"}
    for module, words in uses.items():
        sources = {name: inspect.getsource(sys.modules[group.__module__]) for name, group in run.MEASURED_BY.items()}
        assert {name for name, source in sources.items() if words in source} == set(WANTED_BY[module])


def test_nothing_is_said_of_groups_without_peers() -> None:
    assert missing_peers([name for name in GROUPS if not any(name in groups for groups in WANTED_BY.values())]) == []


def test_each_missing_peer_is_named_with_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embree, "missing", lambda: "embreex is not installed")
    monkeypatch.setattr(mitsuba, "installed", lambda name: True)
    monkeypatch.setattr(mitsuba, "find_llvm", lambda: None)
    monkeypatch.setattr(peers, "installed", lambda name: name == "mitsuba")
    lines = missing_peers(GROUPS)
    assert [line.partition(":")[0] for line in lines] == [
        "no figures of Embree", "no figures of Mitsuba's llvm_ad_rgb", "no figures of PyWavelets", "Packages",
    ]  # fmt: skip
    assert "libllvm19" in lines[1] and "pip install --editable '.[peers]'" in lines[-1]
    assert [line.partition(":")[0] for line in missing_peers(["shaded"])] == ["no figures of Mitsuba's llvm_ad_rgb"]


def test_nothing_is_said_where_all_are_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embree, "missing", lambda: "")
    monkeypatch.setattr(mitsuba, "installed", lambda name: True)
    monkeypatch.setattr(mitsuba, "find_llvm", lambda: "libLLVM.so")
    monkeypatch.setattr(peers, "installed", lambda name: True)
    assert missing_peers(GROUPS) == []


def test_they_are_named_before_anything_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said_before: list[str] = []

    def measured(_options: BenchOptions, _bars: Bars) -> Iterator[Row]:
        said_before.append(capsys.readouterr().err)
        yield Row("order", "a row", "ms", 1.0)

    monkeypatch.setattr(run, "missing_peers", lambda groups: [f"no figures of a peer of {groups}"])
    monkeypatch.setattr(run, "MEASURED_BY", {"order": measured})
    run.run_bench(BenchOptions(tmp_path, only=("order",)))
    assert said_before == ["no figures of a peer of ['order']\n"]
