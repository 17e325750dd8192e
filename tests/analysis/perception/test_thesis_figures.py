"""Figures of the thesis about sampling, and the anomaly at 216 samples."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from analysis.perception.anomaly import chance_rises, described, of_the_set, table
from analysis.perception.options import AnomalyOptions
from analysis.perception.plots import psychometric_figure
from analysis.perception.thesis_figures import densities
from renderer.sampling.plan import SamplePlan, box_warp, triangle_warp
from tests.scripts.commands import call_script, one_line


def test_densities_are_those_of_the_warps() -> None:
    t = (np.arange(100_000) + 0.5) / 100_000
    drawn = densities()
    for name, warped in (("truncated box", box_warp(t, 0.5)), ("triangle", triangle_warp(t))):
        times, density = drawn[name]
        share, edges = np.histogram(warped, 40, (0.0, 1.0), density=True)
        middle = 0.5 * (edges[1:] + edges[:-1])
        np.testing.assert_allclose(np.interp(middle, times, density), share, atol=0.02)


def test_without_a_shift_all_pixels_have_the_same_points() -> None:
    columns, rows = np.array([0, 3, 7]), np.array([0, 5, 1])
    place, time_s = SamplePlan(8, shift="none").samples(columns, rows, 8, 8, 0.0, (0.0, 1.0))
    inside = place * 8.0 - np.stack([columns, rows], axis=1)[:, None]
    assert np.ptp(inside, axis=0).max() < 1e-6 and np.ptp(time_s, axis=0).max() == 0.0
    assert np.ptp(SamplePlan(8).samples(columns, rows, 8, 8, 0.0, (0.0, 1.0))[1], axis=0).max() > 0.0


def test_figures_are_written(tmp_path: Path, monkeypatch, capsys) -> None:
    arguments = ("figures", "--width-px", "16", "--samples", "8", "--out", str(tmp_path))
    assert call_script("perception.py", monkeypatch, *arguments) == 0, capsys.readouterr().err
    names = json.loads((tmp_path / "summary.json").read_text())["figures"]
    assert len(names) == 7
    for name in names:
        with Image.open(tmp_path / f"{name}.png") as picture:
            assert np.asarray(picture.convert("L")).std() > 5.0


def test_the_parts_of_set_and_shift_are_found() -> None:
    """Of errors about 10 with deviations of 2 by the set and 1 by the shift."""
    rng = np.random.default_rng(0)
    rows = 10.0 + rng.normal(0.0, 2.0, (4000, 1)) + rng.normal(0.0, 1.0, (4000, 3))
    assert of_the_set(rows) == pytest.approx((10.0, 2.0, 1.0), rel=0.05)
    lower = 14.0 + rng.normal(0.0, 1.0, (4000, 3))
    (row,) = table({216: rows, 125: lower}, "a").to_dict("records")
    assert (row["samples"], row["lower"]) == (216, 125) and row["set_share"] == pytest.approx(0.2, rel=0.05)
    assert row["deviations"] == pytest.approx(2.0, rel=0.05) and row["chance"] == pytest.approx(0.023, rel=0.2)


def test_curves_rise_by_chance() -> None:
    found = chance_rises(AnomalyOptions(studies=2000))
    assert 0.0 < found[0.1] < found[0.05] < 1.0


def test_the_anomaly_is_measured(tmp_path: Path, monkeypatch, capsys) -> None:
    arguments = ("anomaly", "--levels", "8", "27", "--sets", "2", "--shifts", "2", "--width-px", "16")
    call = (*arguments, "--studies", "100", "--out", str(tmp_path))
    assert call_script("perception.py", monkeypatch, *call) == 0, capsys.readouterr().err
    rows = pd.read_csv(tmp_path / "anomaly.csv")
    assert rows["scene"].tolist() == ["planescene", "spheresscene"] and (rows["mse"] < rows["mse_lower"]).all()
    assert "sets differ by" in capsys.readouterr().out
    for wrong in ("100", "-8"):
        assert call_script("perception.py", monkeypatch, "anomaly", "--levels", wrong, "216") == 2
        assert one_line(capsys.readouterr().err)


def test_sets_that_do_not_differ_are_said_to_be_alike() -> None:
    shifts = np.array([[1.0, 3.0], [3.0, 1.0], [2.0, 2.0]])
    rows = table({27: 2.0 * shifts, 64: shifts}, "planescene")
    assert rows["set_share"].item() == 0.0 and np.isnan(rows["deviations"].item()) and np.isnan(rows["chance"].item())
    assert "sets differ by no more than the shifts do by chance" in described(rows, {})


def test_a_label_says_on_which_side_of_the_levels_a_threshold_lies() -> None:
    trials = pd.DataFrame({"observer": "A", "scene": "plane", "samples": [8, 27, 64], "correct": True})
    for jnd, status, wanted in ((30.0, "within", "30"), (0.0, "below", "below all levels"),
                                (np.inf, "above", "above all levels")):  # fmt: skip
        row = {"mu": 1.4, "sigma": 0.2, "lapse": 0.0, "jnd": jnd, "status": status}
        drawn = psychometric_figure(trials, "scene", {"plane": row}, "human")
        assert f"plane, JND {wanted}" in [text.get_text() for text in drawn.axes[0].texts]
