"""The measurement of the trade from the command line, small: its files, and continuing where it was."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image

from analysis.metrics.front import on_front
from analysis.trade.tables import COLUMNS
from tests.scripts.commands import assert_refused, call_script

SMALL = ("--inputs", "fly-by", "--repetitions", "1", "--seconds", "0.1", "--jod-s", "0", "--draws", "50")
KNOBS = ("--knobs", "resolution", "depth", "tiles")
SEARCH = ("--trials", "2", "--at-once", "2", "--search-knobs", "batch", "smoothing")


def test_a_small_measurement(runs: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    places = ("--out", str(tmp_path / "out"), "--references", str(tmp_path / "cache"))
    assert call_script("trade.py", monkeypatch, *SMALL, *KNOBS, *SEARCH, *places) == 0
    out, shown = tmp_path / "out", capsys.readouterr().out
    assert "The front" in shown and "left out at this scale: tsar, resolution 0.25" in shown and "tiles" in shown

    points = pd.read_csv(out / "trade.csv")
    assert tuple(points.columns[: len(COLUMNS)]) == COLUMNS
    assert set(points["knob"]) == {"resolution", "depth", "tiles", "search"}
    assert (points[["cost_flops", "wall_s", "latency_s", "mse"]] > 0.0).all(axis=None) and points["jod"].isna().all()
    for _, own in points.groupby(["input", "seed"]):
        assert (on_front(own["cost_flops"].to_numpy(), own["mse"].to_numpy()) == own["on_front"]).all()
    depths = points[(points["knob"] == "depth") & (points["input"] == "fly-by")].set_index("value")
    assert depths.loc["0", "rays"] < depths.loc["of the scene", "rays"]

    front = pd.read_csv(out / "tables" / "front.csv").set_index("setting")
    assert front.loc["tsar", "cost"] == front.loc["tsar", "error"] == 1.0 and front["knee"].sum() == 1
    summary = json.loads((out / "summary.json").read_text())
    assert summary["runs"] == summary["runs_done"] == len(runs) and not summary["failures"]
    assert summary["sentences"]["depth"].startswith("Relative to the default (of the scene), 0 has 0.")
    page = (out / "report.html").read_text()
    assert (
        page.count('"group":"fly-by"') >= 8 and "data:image/webp" in page and "http://" not in page.split("</style>")[0]
    )
    assert all(
        Image.open(out / f"{name}.png").width > 300 for name in ("front", "knobs_tsar", "knobs_thesis", "inputs")
    )

    made, files = len(runs), {file.name: file.read_bytes() for file in [out / "trade.csv", *(out / "tables").iterdir()]}
    assert call_script("trade.py", monkeypatch, *SMALL, *KNOBS, *SEARCH, *places) == 0
    assert len(runs) == made, "nothing is run twice, and the search asks for the same settings"
    assert {file.name: file.read_bytes() for file in [out / "trade.csv", *(out / "tables").iterdir()]} == files


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (("--knobs", "nothing"), ("knobs: expected one of policy, batch", "nothing")),
        (("--knobs", "footprnt"), ("knobs: expected one of policy, batch", "(nearest: footprint)")),
        (("--inputs", "nothing"), ("nothing",)),
        (
            ("--inputs", "nothing.pbrt"),
            ("inputs: expected a scene by its name, or a file that is there", "nothing.pbrt"),
        ),
        (("--inputs", "chase", "chase"), ("inputs: expected at least one, none twice",)),
        (("--jod-s", "3"), ("jod_s: expected between 0 and 2",)),
        (("--ledger", "wall"), ("ledger: expected one with repeatable results",)),
    ],
)
def test_bad_options_are_refused(
    arguments: tuple[str, ...], parts: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    status = call_script("trade.py", monkeypatch, *arguments, "--out", str(tmp_path), "--references", str(tmp_path))
    assert_refused(status, capsys, parts)
