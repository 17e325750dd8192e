"""Pictures side by side say what ran, and the best policy is among them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from PIL import Image

from analysis.study.evaluation import Resources
from analysis.suitability.options import SuitabilityOptions
from analysis.suitability.plots import boxes, errors, ratio_over_time
from analysis.suitability.runs import STILLS, runs
from analysis.suitability.stills import best, setting, shown, write_strip
from analysis.suitability.tables import Results
from tests.analysis.suitability.builders import TIMES, result

OPTIONS = SuitabilityOptions(
    inputs=("fly-by",), rows=(6, 7), repetitions=1, rivals=("framed-super", "afr"), policies=("thesis", "tsar")
)
ERRORS = {"framed": 1.0, "framed-super": 0.1, "oracle": 0.2, "tsar": 0.3, "afr": 0.5}


def made(options: SuitabilityOptions, changed: dict[str, float] | None = None) -> Results:
    table = ERRORS | (changed or {})
    images = np.arange(TIMES) // 4
    return Results([result(run, table.get(run.label, 0.7), refresh=images) for run in runs(options)])


def test_a_setting_is_what_ran_and_names_the_row_of_the_thesis() -> None:
    """Row 7 is batch 128 at 512²; a quick study has a quarter of the side and a sixteenth of the samples."""
    texts = {(run.label, run.row): setting(run) for run in runs(OPTIONS)}
    assert texts["thesis", 7] == "batch 8, 128² (thesis: 128, 512²)" and texts["framed-super", None] in ("64²", "128²")
    whole = {(run.label, run.row): setting(run) for run in runs(dataclasses.replace(OPTIONS, scale="thesis"))}
    assert whole["thesis", 7] == "batch 128, 512²"


def test_figures_say_what_ran() -> None:
    results = made(OPTIONS)
    over_time, all_errors, boxed = (
        ratio_over_time(results, 7),
        errors(results, "fly-by"),
        boxes(results, ["fly-by"], ""),
    )
    assert over_time is not None and all_errors is not None and boxed is not None
    assert "row 7: batch 8, 128² (thesis: 128, 512²)" in over_time.axes[0].get_title(loc="left")
    named = [text.get_text() for axis in all_errors.axes for text in axis.texts]
    assert "batch 8, 128² (thesis: 128, 512²)" in named and not any(text.startswith("batch 128") for text in named)
    assert "128² (thesis: 512²)" in [text.get_text() for text in boxed.legends[0].get_texts()]


def test_the_best_policy_is_neither_framed_nor_sees_the_truth_and_is_shown() -> None:
    titles = [title for title, _ in shown(made(OPTIONS), "fly-by")]
    assert titles == [
        "framed 128²",
        "thesis batch 8, 128² (thesis: 128, 512²)",
        "tsar batch 8, 128² (thesis: 128, 512²)\nof all policies the least error",
    ]
    least = best(made(OPTIONS, {"thesis": 0.01}), "fly-by", 128)
    assert least is not None and least.run.label == "thesis"
    titles = [title for title, _ in shown(made(OPTIONS, {"thesis": 0.01}), "fly-by")]
    assert len(titles) == 2 and titles[1].endswith("the least error"), "once, and marked"


def test_pictures_of_the_strip_are_those_of_their_runs(tmp_path: Path) -> None:
    results, place = made(OPTIONS), Resources(tmp_path / "runs", tmp_path)
    keys = {one.run.case: one.run.case.name for one in results.all}
    strip = tmp_path / "strip.png"
    assert write_strip(strip, OPTIONS, results, "fly-by", keys, place) is None, "no picture is on disk"
    ours = next(one for title, one in shown(results, "fly-by") if title.startswith("tsar"))
    file = place.still(keys[ours.run.case], "shown", len(STILLS) - 1)
    file.parent.mkdir(parents=True)
    Image.new("RGB", (8, 8), (255, 0, 255)).save(file)
    assert write_strip(strip, OPTIONS, results, "fly-by", keys, place) == strip
    colours = Image.open(strip).convert("RGB").getcolors(1 << 20) or []
    assert max(count for count, colour in colours if colour == (255, 0, 255)) > 10_000
