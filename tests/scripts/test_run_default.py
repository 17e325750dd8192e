"""A comparison that names no policies: what runs, what is counted, and what its page shows."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from analysis import load
from analysis.comparison.experiment import RunOptions, run_experiment
from analysis.page.comparer import read_comparer
from tests.scripts.test_run import IMAGES, options
from tsar.config import ConfigError


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("default")


@pytest.fixture(scope="module")
def default(folder: Path) -> tuple[dict[str, Any], Path]:
    """Summary and page of a run that names no policies."""
    usual = options(folder, "default", threads=2)
    named = {"policy": RunOptions.policy, "rivals": RunOptions.rivals, "capacity": 3e9}
    run_experiment(dataclasses.replace(usual, **named, film=True))
    found = json.loads((folder / "default" / "summary.json").read_text())
    return found, folder / "default" / "report.html"


def test_the_best_policy_runs_beside_framed_rivals_and_the_dissertations(default: tuple[dict[str, Any], Path]) -> None:
    summary, _ = default
    assert summary["policy"] == "tsar" and summary["rivals"][0] == "framed" and "thesis" in summary["rivals"]
    assert list(summary["mse"]) == ["tsar", *summary["rivals"]]
    errors = {name: np.array(values) for name, values in summary["mse"].items()}
    assert all(found.shape == (IMAGES,) and (found > 0.0).all() for found in errors.values())
    assert summary["ratio"] == pytest.approx(errors["tsar"] / errors["framed"])


def test_a_policy_without_records_is_counted_and_those_of_a_rival_are_kept(
    default: tuple[dict[str, Any], Path], folder: Path
) -> None:
    summary, _ = default
    assert 0.2 <= summary["cycles"] * summary["cycle_s"] <= 0.25, "up to the last image of the reference"
    assert summary["samples_traced"] % summary["cycles"] == 0 < summary["samples_traced"]
    assert sum(summary["stage_flops"].values()) == pytest.approx(summary["cycles"] * summary["cycle_s"] * 3e9)
    assert summary["stage_flops"].keys() == {"tracing", "all others"}
    assert summary["overdraw"] is summary["saturation"] is summary["age_spread_s"] is None
    assert summary["recorded"] == "thesis" and summary["invariants"]["runs"] == ["thesis"]
    table = pq.read_table(folder / "default" / "steps.parquet", columns=["cycle"])
    assert summary["invariants"]["cycles"] == table.num_rows and summary["invariants"]["ok"]
    loaded = load(folder / "default")
    assert loaded.attrs["policy"] == "tsar" and loaded.attrs["recorded"] == "thesis" and "density_spatial" in loaded


def test_the_page_and_the_summary_name_the_scores(default: tuple[dict[str, Any], Path]) -> None:
    summary, page = default
    assert summary["config"]["resolved"]["metrics"] == ["flip", "jod"] == list(summary["metrics"])
    text = page.read_text()
    for metric in ("flip", "jod"):
        values = {name: value for name, value in summary["metrics"][metric].items() if name != "tsar"}
        best = min(values, key=values.__getitem__) if metric == "flip" else max(values, key=values.__getitem__)
        named = ", ".join(f"{name} {values[name]:.3g}" for name in dict.fromkeys(("framed", best)))
        assert f"{metric.upper()} is {summary['metrics'][metric]['tsar']:.3g} ({named}; " in text
    if len(summary["rivals"]) > 1:
        ratio = summary["best_rival"]["ratio_statistics"]["median"]
        assert f"It is {ratio:.3f} times the least of all rivals" in text


def test_the_page_begins_with_the_best_framed_rival_beside_the_policy(default: tuple[dict[str, Any], Path]) -> None:
    summary, page = default
    framed = [name for name in summary["rivals"] if name != "thesis"]
    shown = read_comparer(page)
    assert shown.left == min(framed, key=lambda name: np.median(summary["mse"][name])) and shown.right == "tsar"
    labels = {panel.label for panel in shown.panels}
    assert {"reference", "tsar", *summary["rivals"]} <= labels, "no run is left out"
    assert {"rate of change", "expected error", "age of samples", "thesis: spatial density"} <= labels


def test_the_policy_is_left_out_of_the_rivals_that_are_usual() -> None:
    assert "thesis" not in RunOptions("fly-by", policy="thesis").rivals
    with pytest.raises(ConfigError, match="rivals: expected names that differ"):
        RunOptions("fly-by", policy="thesis", rivals=("thesis", "framed"))
