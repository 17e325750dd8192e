"""The table of structures and the report's images, small."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from scenes.effects import report_images as report
from tests.scripts.commands import call_script


def test_the_table_says_what_rays_take(tmp_path: Path, monkeypatch, capsys) -> None:
    out = tmp_path / "out"
    status = call_script(
        "accelerators.py", monkeypatch, "--triangles", "100", "2000", "--repetitions", "1", "--out", str(out)
    )
    assert status == 0
    rows = pd.read_csv(out / "table.csv").set_index(["triangles", "rays", "structure"])
    sizes = rows.index.get_level_values("triangles").unique()
    assert len(rows) == 2 * 2 * 3 and (out / "tests.png").stat().st_size > 10_000
    for size in sizes:
        assert rows.loc[(size, "camera", "brute"), "tests_per_ray"] == size
        for structure in ("kdtree", "bvh"):
            assert rows.loc[(size, "camera", structure), "tests_per_ray"] < size
    large = rows.loc[(sizes[1], "random")]
    assert large.loc["kdtree", "fewer_tests_than_brute"] > 20.0
    assert len(json.loads((out / "summary.json").read_text())["rows"]) == 12
    assert "kdtree" in capsys.readouterr().out


def test_the_reports_images_at_a_fraction_of_their_size(tmp_path: Path, monkeypatch, capsys) -> None:
    out = tmp_path / "out"
    arguments = ("--image", *report.IMAGES, "--image-scale", "0.02", "--out", str(out))
    assert call_script("accelerators.py", monkeypatch, *arguments) == 0
    images = json.loads((out / "summary.json").read_text())["images"]
    for name, polygons, kinds in (
        ("report-one", 10_100, {"shadow_rays", "reflection_rays"}),
        ("report-two", 5_500, {"shadow_rays", "reflection_rays", "refraction_rays"}),
    ):
        each = images[name]
        assert each["polygons"] == pytest.approx(polygons, rel=0.01)
        assert each["samples_per_pixel"] == 32 and all(each[kind] > each["primary_rays"] / 10 for kind in kinds)
        # brute force for all rays takes more than twenty times as many
        assert each["fewer_tests_than_brute"] > 20.0
        assert (out / f"{name}.png").exists() and (out / f"{name}.exr").exists()
    assert "report: 18.5 G tests" in capsys.readouterr().out


def test_the_scenes_have_what_the_report_names() -> None:
    one, two = (report.load(name) for name in report.IMAGES)
    assert (one.film.width_px, one.film.height_px, two.film.width_px, two.film.height_px) == (1000, 800, 800, 600)
    assert one.integrator.reflection_rays == two.integrator.reflection_rays == two.integrator.refraction_rays == 8
    assert one.integrator.shadow_rays == "one"
