"""Clusters of processes: who can reach them, and the messages when they end."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import dask.config
import distributed  # noqa: F401  (its defaults must be there before a test sets and restores one)
import psutil
import pytest

from analysis.command.awaited import unseen
from analysis.command.cluster import ClusterOptions, connected
from analysis.command.progress import Task
from analysis.study import farm
from analysis.study.cases import Case, Scale
from analysis.study.evaluation import Resources
from analysis.study.farm import describe_failures, run_cases
from tests.scripts.commands import ROOT
from tsar.config import TsarConfig

TINY = Scale(4, seconds=0.2, reference_rate_hz=30.0, reference_samples_per_axis=1, stride=2)


def cases(count: int) -> list[Case]:
    configs = [TINY.config(0, TsarConfig(seed=seed)) for seed in range(count)]
    return [Case(input="fly-by", policy="thesis", tsar=config, scale=TINY) for config in configs]


@pytest.fixture
def place(tmp_path: Path) -> Resources:
    return Resources(tmp_path / "runs", tmp_path / "references")


def sleep_as_a_run(*_: Any) -> None:
    time.sleep(60)


def exit_as_a_run(*_: Any) -> None:
    os._exit(1)


def fail_once(animation: Any, start_s: float, scale: Scale, place: Resources) -> None:
    try:
        (place.results / "tried").mkdir(parents=True)
    except FileExistsError:
        return
    raise ValueError("the first try")


def keep_nothing(case: Case, key: str, *_: Any) -> str:
    return key


@pytest.mark.parametrize("retries", [0, 1])
def test_what_failed_is_tried_again_if_asked(retries: int, place: Resources, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(farm, "_prepare", fail_once)
    monkeypatch.setattr(farm, "_evaluate", keep_nothing)
    asked, lines = cases(1), list[str]()
    keys, failures = run_cases(asked, place, ClusterOptions(workers=1, retries=retries), say=lines.append)
    assert list(keys) == asked and list(failures.values()) == ["ValueError: the first try"] * (1 - retries)
    assert len(lines) == 1 and lines[0].startswith("dashboard of Dask: ")


def test_a_local_cluster_adapts_and_limits_memory() -> None:
    with connected(ClusterOptions(workers=2, workers_least=1, memory_limit_gib=1.5)) as client:
        assert len(client.scheduler_info()["workers"]) == 1
        waiting = [client.submit(time.sleep, 3.0, pure=False) for _ in range(8)]
        client.wait_for_workers(2, timeout=120)
        limits = {one["memory_limit"] for one in client.scheduler_info()["workers"].values()}
        client.cancel(waiting)
    assert limits == {3 * 2**29}


def test_a_local_cluster_listens_on_loopback_only() -> None:
    with connected(ClusterOptions(workers=1)) as client:
        assert client.submit(int, 3).result() == 3
        assert listening_hosts() == {"127.0.0.1"}
        workers = client.scheduler_info()["workers"].values()
        assert len(workers) == 1 and all(one["host"] == "127.0.0.1" for one in workers)


def listening_hosts() -> set[str]:
    """Hosts at which this process and its children listen."""
    ours = [psutil.Process(), *psutil.Process().children(recursive=True)]
    places = [place for one in ours for place in one.net_connections("inet")]
    return {place.laddr.ip for place in places if place.status == psutil.CONN_LISTEN}


def test_the_dashboard_is_at_the_printed_address_on_loopback_only() -> None:
    pytest.importorskip("bokeh")
    lines = list[str]()
    with connected(ClusterOptions(workers=1), lines.append):
        (line,) = lines
        address = line.removeprefix("dashboard of Dask: ")
        assert address.startswith("http://127.0.0.1:") and address.endswith("/status")
        with urllib.request.urlopen(address, timeout=60) as page:
            assert page.status == 200 and b"bokeh" in page.read().lower()
        assert listening_hosts() == {"127.0.0.1"}


def test_without_a_dashboard_the_line_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "bokeh", None)
    lines = list[str]()
    with connected(ClusterOptions(workers=1), lines.append):
        pass
    assert len(lines) == 1 and "bokeh is not installed; the extra 'study' of tsar-render installs it" in lines[0]


def test_runs_whose_workers_die_fail_with_the_reason(place: Resources, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(farm, "_prepare", exit_as_a_run)
    asked, told = cases(2), list[int]()
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        _, failures = run_cases(asked, place, ClusterOptions(workers=1), Task(show=told.append))
    assert set(failures) == set(asked) and told[-1] == 2
    assert all("KilledWorker" in reason for reason in failures.values()), failures


def started_worker(address: str) -> subprocess.Popen:
    command = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-nanny", "--no-dashboard"]
    home = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(command, stderr=subprocess.DEVNULL, cwd=ROOT, env=home)


@pytest.fixture
def cluster() -> Iterator[tuple[str, subprocess.Popen, list[subprocess.Popen]]]:
    """Address and processes of a scheduler and a worker of others."""
    module, home = [sys.executable, "-m"], {"cwd": ROOT, "env": {**os.environ, "PYTHONPATH": str(ROOT)}}
    command = [*module, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    scheduler = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, **home)
    assert scheduler.stderr is not None
    line = next(line for line in scheduler.stderr if "Scheduler at:" in line)
    address = line.split()[-1]
    drain = threading.Thread(target=scheduler.stderr.read, daemon=True)
    drain.start()
    workers = [started_worker(address)]
    yield address, scheduler, workers
    for process in (*workers, scheduler):
        process.kill()
        process.wait()


@pytest.mark.parametrize("ended", ["scheduler", "workers"])
def test_a_cluster_that_ends_is_said(
    ended: str, cluster: Any, place: Resources, monkeypatch: pytest.MonkeyPatch
) -> None:
    address, scheduler, workers = cluster
    monkeypatch.setattr(farm, "_prepare", sleep_as_a_run)
    asked, logged = cases(3), list[logging.LogRecord]()
    seen = logging.Handler()
    seen.emit = logged.append
    monkeypatch.setattr(logging.getLogger("distributed.client"), "handlers", [seen])

    def end() -> None:
        for process in [scheduler] if ended == "scheduler" else workers:
            process.send_signal(signal.SIGKILL)

    submit = farm._submit

    def submit_and_end(*given: Any) -> Any:
        found = submit(*given)
        threading.Timer(1.0, end).start()
        return found

    monkeypatch.setattr(farm, "_submit", submit_and_end)
    _, failures = run_cases(asked, place, ClusterOptions(scheduler=address, worker_wait_s=3))
    assert set(failures) == set(asked)
    expected = "no worker was there" if ended == "workers" else "scheduler"
    assert all(expected in reason and reason.endswith(GO_ON) for reason in failures.values()), failures
    assert not [record for record in logged if record.exc_info]


GO_ON = "the same command goes on with what is missing"


def test_results_that_are_not_here_are_failures(
    cluster: Any, place: Resources, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(farm, "_prepare", keep_nothing)
    monkeypatch.setattr(farm, "_evaluate", keep_nothing)
    monkeypatch.setattr(farm, "unseen", partial(unseen, wait_s=0.0))
    _, failures = run_cases(cases(2), place, ClusterOptions(scheduler=cluster[0], worker_wait_s=300))
    (reason,) = set(failures.values())
    assert len(failures) == 2 and reason.endswith("all machines must see the same folder --out")


def test_files_of_other_machines_are_waited_for(tmp_path: Path) -> None:
    asked = [tmp_path / "one", tmp_path / "two"]
    threading.Timer(0.3, asked[0].touch).start()
    assert unseen(asked, wait_s=2.0) == asked[1:]


def test_every_worker_keeps_freed_memory_whenever_it_comes(place: Resources, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = list[bool]()
    monkeypatch.setattr(farm, "_keep_freed_memory", lambda: kept.append(True))
    monkeypatch.setattr("analysis.study.evaluation.evaluate", keep_nothing)
    monkeypatch.setattr("analysis.study.scenery.render_reference", keep_nothing)
    (case,) = cases(1)
    farm._prepare(case.animation, case.start_s, case.scale, place)
    farm._evaluate(case, "key", place, None)
    assert len(kept) == 2


def test_a_reason_is_said_once() -> None:
    assert describe_failures({"a": "full", "b": "died", "c": "full"}) == [
        "failed: a and 1 more: full",
        "failed: b: died",
    ]
    assert describe_failures({}) == []
