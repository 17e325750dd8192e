"""Non-finite samples and values are counted for every policy, in the summary, the output and the study."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import torch

from analysis.study.cases import Case, Scale, framed_config
from analysis.study.evaluation import Resources, evaluate, finished, source_of_results
from analysis.study.runs import Totals
from renderer.trace import Renderer
from tests.scripts.commands import call_script
from tsar.config import TsarConfig
from tsar.policies import framed
from tsar.types import SampleBatch, StepRecord

BATCH, BAD = 16, 16
"""Framelets a cycle, and samples in each that are not finite: every 17th of 256."""

RIVALS = ("framed", "afr", "frameless")


@pytest.fixture
def broken_renderer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes the renderer return NaN now and then, and puts one NaN into each picture of the reference."""
    trace, render_frame = Renderer.trace, Renderer.render_frame

    def some_bad(renderer: Renderer, *arguments: Any) -> SampleBatch:
        found = trace(renderer, *arguments)
        color = found.color.clone()
        color[:, ::17] = float("nan")
        return SampleBatch(color, found.counters)

    def one_bad(renderer: Renderer, *arguments: Any) -> torch.Tensor:
        image = render_frame(renderer, *arguments).clone()
        image[0, 0, 0] = float("inf")
        return image

    monkeypatch.setattr(Renderer, "trace", some_bad)
    monkeypatch.setattr(Renderer, "render_frame", one_bad)


def run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[int, dict[str, Any]]:
    """Exit status and summary of a small run."""
    small = ("--seconds", "0.2", "--resolution-px", "64", "--batch-size", str(BATCH), "--warmup-cycles", "4")
    reference = (
        "--reference-samples-per-axis",
        "1",
        "--reference-rate-hz",
        "20",
        "--references",
        str(folder / "cache"),
    )
    rest = (
        "--capacity",
        "8.7e10",
        "--policy",
        "thesis",
        "--rivals",
        *RIVALS,
        "--no-film",
        "--out",
        str(folder / "out"),
    )
    status = call_script("run.py", monkeypatch, "fly-by", *small, *reference, *rest)
    return status, json.loads((folder / "out" / "summary.json").read_text())


def test_a_run(
    tmp_path: Path, broken_renderer: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    status, summary = run(tmp_path, monkeypatch)
    found, cycles = summary["nonfinite"], pd.read_parquet(tmp_path / "out" / "steps.parquet")["cycle"]
    assert status == 0 and found["thesis"] == BATCH * BAD * (cycles >= 0).sum() > 0
    assert all(found[name] > 0 for name in RIVALS)
    assert found["fields"] == 0 and found["reference"] == 4
    printed = [line for line in capsys.readouterr().out.splitlines() if "non-finite" in line]
    assert len(printed) == 1 and str(sum(found.values())) in printed[0]


def test_images_and_fields_of_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two values of every whole frame, and three densities of every cycle."""
    whole, add = framed.frame_image, Totals.add

    def two_bad(*arguments: Any) -> torch.Tensor:
        image = whole(*arguments).clone()
        image[5, 6, :2] = float("nan")
        return image

    def three_bad(totals: Totals, record: StepRecord) -> None:
        add(totals, dataclasses.replace(record, nonfinite_fields=3))

    monkeypatch.setattr(framed, "frame_image", two_bad)
    monkeypatch.setattr(Totals, "add", three_bad)
    status, summary = run(tmp_path, monkeypatch)
    found = summary["nonfinite"]
    assert status == 0 and found["fields"] == 3 * summary["cycles"] > 0
    assert found["framed"] == 2 * summary["images"]["framed"] > 0 and found["thesis"] == found["afr"] == 0


@pytest.mark.parametrize("policy", ["thesis", *RIVALS, "oracle"])
def test_a_case_of_a_study(policy: str, tmp_path: Path, broken_renderer: None) -> None:
    scale = Scale(4, seconds=0.2, reference_rate_hz=20.0, reference_samples_per_axis=1, stride=2)
    config = framed_config(64) if policy == "framed" else scale.config(0, TsarConfig(warmup_cycles=4))
    case, place = Case("fly-by", policy, config, scale), Resources(tmp_path / "runs", tmp_path / "cache")
    found = finished(evaluate(case, case.key(source_of_results()), place), place)
    assert found is not None and found["nonfinite_samples"] > 0 and found["reference_nonfinite"] == 4
    if policy == "thesis":
        assert found["nonfinite_samples"] == config.batch_size * BAD * found["cycles"]
    assert found["nonfinite"] == 0, "none of them is shown"
