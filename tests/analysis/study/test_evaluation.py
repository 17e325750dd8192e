"""One case, run and put on disk; many of them through a cluster. Small pictures, really rendered."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from PIL import Image

import analysis.study.evaluation as evaluation
from analysis.command.cluster import ClusterOptions
from analysis.command.progress import Task
from analysis.metrics.budget import SHARES
from analysis.study.cases import Case, Scale, framed_config
from analysis.study.evaluation import Resources, evaluate, finished, source_of_results, times_of
from analysis.study.farm import run_cases
from tsar.config import ConfigError, TsarConfig

TINY = Scale(4, seconds=0.2, reference_rate_hz=30.0, reference_samples_per_axis=1, stride=2)
TIMES = 6


def case(policy="thesis", **changes) -> Case:
    config = framed_config(64) if policy.startswith("framed") else TINY.config(0, TsarConfig(warmup_cycles=8))
    return Case(**{"input": "fly-by", "policy": policy, "tsar": config, "scale": TINY, **changes})


def key(one: Case) -> str:
    return one.key(source_of_results())


def content(place: Resources, name: str) -> tuple[bytes, list[bytes], dict]:
    """A result without its measurements of the machine."""
    files = place.files(name)
    summary = json.loads(files["summary"].read_text())
    stills = [(place.results / still).read_bytes() for still in summary["stills"]]
    return files["times"].read_bytes(), stills, {one: value for one, value in summary.items() if one != "machine"}


@pytest.fixture(scope="module")
def references(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("references")


@pytest.fixture
def place(tmp_path: Path, references: Path) -> Resources:
    return Resources(tmp_path / "runs", references)


def test_a_result_holds_every_reference_time(place: Resources) -> None:
    one = case(stills_s=(0.1,), jod_span_s=(0.0, 0.2))
    name = evaluate(one, key(one), place)
    table, found = pd.read_parquet(place.files(name)["times"]), finished(name, place)
    assert found is not None and name == key(one)
    assert np.allclose(table["time_s"], np.arange(TIMES) / 30)
    assert (table["mse"] > 0).all() and table["ssim"].notna().tolist() == [True, False] * 3
    assert found["jod"] < 10 and found["invariants"]["ok"] and found["cycles"] > 0 and found["nonfinite"] == 0
    known = table.dropna(subset="causes_mse")
    parts = known[["aliasing", "blur", "lag", "mixed"]].sum(axis=1)
    assert len(known) and np.allclose(parts, known["causes_mse"], rtol=1e-9)
    for what, side in (("shown", 64), ("reference", 64), ("tiling", 256)):
        assert Image.open(place.still(name, what, 0)).size == (side, side)
    assert not list(place.results.glob("*.lock")) and not list(place.results.glob("*.partial*"))


@pytest.mark.parametrize(
    "policy", ["framed", "framed-super", "framed-quarter", "framed-taa-late", "frameless", "afr", "oracle"]
)
def test_every_policy_runs(policy: str, place: Resources) -> None:
    one = case(policy)
    table = pd.read_parquet(place.files(evaluate(one, key(one), place))["times"])
    assert len(table) == TIMES and (table["mse"] > 0).all()


def test_the_oracle_is_better_than_what_does_not_look(place: Resources) -> None:
    errors = {}
    for policy in ("thesis", "framed", "oracle"):
        one = case(policy)
        errors[policy] = pd.read_parquet(place.files(evaluate(one, key(one), place))["times"])["mse"].mean()
    assert errors["oracle"] < min(errors["thesis"], errors["framed"])


def test_threads_change_nothing(place: Resources, references: Path, tmp_path: Path) -> None:
    one, threads = case(), torch.get_num_threads()
    found = []
    for number, count in enumerate((1, 2)):
        other = Resources(tmp_path / str(number), references, threads=count)
        torch.set_num_threads(count)
        try:
            found.append(content(other, evaluate(one, key(one), other)))
        finally:
            torch.set_num_threads(threads)
    assert found[0] == found[1]


def test_a_result_on_disk_is_not_made_again(place: Resources, monkeypatch: pytest.MonkeyPatch) -> None:
    one = case()
    evaluate(one, key(one), place)
    before = content(place, key(one))
    monkeypatch.setattr(evaluation, "_run", lambda *a: pytest.fail("made again"))
    evaluate(one, key(one), place)
    assert content(place, key(one)) == before


@pytest.fixture(scope="module")
def made(references: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Resources, str]:
    """A result with stills."""
    one, place = case("framed", stills_s=(0.1,)), Resources(tmp_path_factory.mktemp("made"), references)
    return place, evaluate(one, key(one), place)


@pytest.mark.parametrize("damage", ["lost", "cut", "bit", "exchanged"])
@pytest.mark.parametrize("part", ["summary", "times", "still"])
def test_a_damaged_result_is_named_and_made_again(
    part: str, damage: str, made: tuple[Resources, str], place: Resources, capsys: pytest.CaptureFixture
) -> None:
    """As after a kill between its files, a bit that flipped, or the file of another run in its place."""
    whole, name = made
    shutil.copytree(whole.results, place.results)
    file = place.still(name, "shown", 0) if part == "still" else place.files(name)[part]
    written = bytearray(file.read_bytes())
    file.unlink()
    if damage == "cut":
        file.write_bytes(written[:40])
    elif damage == "bit":
        written[len(written) // 2] ^= 4
        file.write_bytes(written)
    elif damage == "exchanged":
        other = case("framed", phase=0.25, stills_s=(0.1,))
        evaluate(other, key(other), place)
        theirs = place.still(key(other), "shown", 0) if part == "still" else place.files(key(other))[part]
        shutil.copy(theirs, file)
        assert file.read_bytes() != written
    assert finished(name, place) is None
    assert (f"{file}: is damaged" in capsys.readouterr().err) == (damage != "lost")
    one = case("framed", stills_s=(0.1,))
    evaluate(one, name, place)
    assert content(place, name) == content(whole, name) and finished(name, place) is not None


def test_a_table_that_is_damaged_is_not_read(made: tuple[Resources, str], place: Resources) -> None:
    shutil.copytree(made[0].results, place.results)
    assert len(times_of(made[1], place)) == TIMES
    place.files(made[1])["times"].write_bytes(b"")
    with pytest.raises(ValueError, match="expected the table of a finished run"):
        times_of(made[1], place)


def test_a_run_that_fails_leaves_nothing_that_counts(place: Resources) -> None:
    """Without a warm-up there is nothing on the display when the measurement starts."""
    bad = case(tsar=TINY.config(0, TsarConfig(warmup_cycles=0)))
    with pytest.raises(ValueError, match="nothing is shown yet"):
        evaluate(bad, key(bad), place)
    assert finished(key(bad), place) is None and not list(place.results.glob("*.parquet"))


def test_another_source_is_refused(place: Resources) -> None:
    with pytest.raises(ValueError, match="expected a worker with the source of the command"):
        evaluate(case(), case().key("other source"), place)


def test_other_rates_of_the_display_are_refused(place: Resources) -> None:
    odd = dataclasses.replace(TINY, reference_rate_hz=25.0)
    with pytest.raises(ConfigError, match="reference_rate_hz"):
        evaluate(case(scale=odd, jod_span_s=(0.0, 0.2)), key(case(scale=odd, jod_span_s=(0.0, 0.2))), place)


def test_two_processes_give_what_one_gives_and_a_failure_stops_no_other(
    place: Resources, references: Path, tmp_path: Path
) -> None:
    bad = case(tsar=TINY.config(0, TsarConfig(warmup_cycles=0)))
    cases = [case(), bad, case("framed"), case("afr"), case()]
    many = Resources(tmp_path / "many", references)
    told: list[int] = []
    keys, failures = run_cases(cases, many, ClusterOptions(workers=2), Task(show=told.append))
    assert set(failures) == {bad} and "nothing is shown yet" in failures[bad]
    assert told == [0, 1, 2, 3, 4], "one that occurs twice is one"
    for one in (case(), case("framed"), case("afr")):
        assert content(many, keys[one]) == content(place, evaluate(one, key(one), place))
    again, failures = run_cases(cases[2:], many, ClusterOptions(scheduler="tcp://nowhere:1"))
    assert not failures and again[case()] == keys[case()], "what is on disk needs no cluster"


def test_a_running_cluster_is_used_by_its_address(place: Resources) -> None:
    from distributed import LocalCluster

    one = case("framed")
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster:
        keys, failures = run_cases([one], place, ClusterOptions(scheduler=cluster.scheduler_address))
        assert len(cluster.scheduler.workers) == 1, "the cluster is not ours to close"
    assert not failures and finished(keys[one], place) is not None


def test_parts_of_the_policy_are_left_out_and_named(place: Resources) -> None:
    whole, less = case("tsar"), case("tsar", parts=(("smoothing", False),))
    tables = [pd.read_parquet(place.files(evaluate(one, key(one), place))["times"]) for one in (whole, less)]
    assert (tables[0]["mse"] != tables[1]["mse"]).all() and "tsar-smoothing-0-fly-by" in key(less)
    assert not any(name.startswith("budget") for name in tables[0])
    with pytest.raises(ConfigError, match="^parts: expected none but of tsar"):
        case("thesis", parts=(("smoothing", False),))


@pytest.mark.parametrize("policy", ["tsar", "framed"])
def test_the_budget_of_an_error_adds_up(policy: str, place: Resources) -> None:
    """At every time, with the truth rendered at the time that the image shows; the longer a frame is shown, the larger
    the floor that its latency sets."""
    one = case(policy, budget_s=0.05)
    table = pd.read_parquet(place.files(evaluate(one, key(one), place))["times"])
    assert len(table) == TIMES and np.allclose(table[[f"budget_{name}" for name in SHARES]].sum(axis=1), table["mse"])
    assert (table["budget_floor"] > 0).all() and (table["budget_late_s"] > 0).all()
    assert table["budget_uncovered"].between(0.0, 0.9).all() and table["budget_uncovered"].max() > 0.0
    assert (table["budget_blur"] == 0.0).all() == (policy == "framed")
    if policy == "framed":
        assert (np.diff(table["budget_floor"][table["refresh"] == table["refresh"].iloc[0]]) > 0).all()


@pytest.mark.parametrize("seconds", [0.0, -1.0, 11.0])
def test_a_budget_over_no_time_is_refused(seconds: float) -> None:
    with pytest.raises(ConfigError, match="^budget_s: expected seconds in"):
        case("tsar", budget_s=seconds)
