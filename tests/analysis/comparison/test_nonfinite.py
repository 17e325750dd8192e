"""Samples and values that are not finite are counted by every policy, in everything that says how a run went."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import torch

from analysis.study.cases import Case, Scale, framed_config
from analysis.study.evaluation import Place, evaluate, finished, source_of_results
from renderer.trace import Renderer
from tests.scripts.commands import call_script
from tsar.config import TsarConfig
from tsar.types import SampleBatch

BATCH, BAD = 16, 16
"""Framelets a cycle, and samples in each that are not finite: every 17th of 256."""

RIVALS = ("framed", "afr", "frameless")


@pytest.fixture
def broken_renderer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Has the renderer answer with NaN now and then, and one in each picture of the reference."""
    trace, render_frame = Renderer.trace, Renderer.render_frame

    def some_bad(renderer: Renderer, batch: Any) -> SampleBatch:
        found = trace(renderer, batch)
        color = found.color.clone()
        color[:, ::17] = float("nan")
        return SampleBatch(color, found.counters)

    def one_bad(renderer: Renderer, *arguments: Any) -> torch.Tensor:
        image = render_frame(renderer, *arguments).clone()
        image[0, 0, 0] = float("inf")
        return image

    monkeypatch.setattr(Renderer, "trace", some_bad)
    monkeypatch.setattr(Renderer, "render_frame", one_bad)


def test_a_run(
    tmp_path: Path, broken_renderer: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    small = ("--seconds", "0.2", "--resolution-px", "64", "--batch-size", str(BATCH), "--warmup-cycles", "4")
    reference = ("--reference-samples-per-axis", "1", "--reference-rate-hz", "20", "--cache", str(tmp_path / "cache"))
    rest = ("--rivals", *RIVALS, "--no-film", "--out", str(tmp_path / "out"))
    assert call_script("run.py", monkeypatch, "fly-by", *small, *reference, *rest) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    found, cycles = summary["nonfinite"], pd.read_parquet(tmp_path / "out" / "steps.parquet")["cycle"]
    assert found["tsar"] == BATCH * BAD * (cycles >= 0).sum() > 0
    assert all(found[name] > 0 for name in RIVALS)
    assert found["fields"] == 0 and found["reference"] == 4
    printed = [line for line in capsys.readouterr().out.splitlines() if "non-finite" in line]
    assert len(printed) == 1 and str(sum(found.values())) in printed[0]


@pytest.mark.parametrize("policy", ["tsar", *RIVALS, "oracle"])
def test_a_case_of_a_study(policy: str, tmp_path: Path, broken_renderer: None) -> None:
    scale = Scale(4, seconds=0.2, reference_rate_hz=20.0, reference_samples_per_axis=1, stride=2)
    config = framed_config(64) if policy == "framed" else scale.config(0, TsarConfig(warmup_cycles=4))
    case, place = Case("fly-by", policy, config, scale), Place(tmp_path / "runs", tmp_path / "cache")
    found = finished(evaluate(case, case.key(source_of_results()), place), place)
    assert found is not None and found["nonfinite_samples"] > 0 and found["reference_nonfinite"] == 4
    if policy == "tsar":
        assert found["nonfinite_samples"] == config.batch_size * BAD * found["cycles"]
    assert (found["nonfinite"] > 0) == (policy == "framed"), "only whole frames are shown as they were traced"
