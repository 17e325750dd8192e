"""Scores of stimuli on disk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import analysis.metrics.perceptual
from analysis.command.progress import Bars
from analysis.metrics.display_model import DisplayModel
from analysis.perception.stimuli import differences
from tests.analysis.perception.builders import LEVELS, write_stimuli


def test_scores_are_kept_and_a_damaged_one_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    scored = []

    def score(test: np.ndarray, reference: np.ndarray, rate_hz: float, display: DisplayModel) -> float:
        scored.append(test)
        return 10.0 - float(np.abs(test.astype(float) - reference).mean())

    # of the module that it is said to be from, so that the scores are of the same code
    score.__module__ = analysis.metrics.perceptual.__name__
    monkeypatch.setattr(analysis.metrics.perceptual, "jod", score)
    folder, shown = write_stimuli(tmp_path, side=8, frames=1), DisplayModel()

    def found() -> tuple[pd.DataFrame, int]:
        scored.clear()
        return differences(folder, shown, Bars()), len(scored)

    whole, made = found()
    assert made == len(LEVELS) - 1 and whole["jod"].iloc[-1] == 0.0 and (whole["jod"].iloc[:-1] > 0.0).all()
    same, made = found()
    assert made == 0 and same.equals(whole)
    (kept,) = folder.glob("jod*")
    content = kept.read_bytes()
    for at in range(0, len(content), 7):
        kept.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
        same, made = found()
        assert same.equals(whole) and 1 <= made <= 2, at
        assert "damaged line" in capsys.readouterr().err
    kept.write_bytes(content[:-9])
    same, made = found()
    assert made == 1 and same.equals(whole)
