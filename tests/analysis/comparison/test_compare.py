"""Comparisons from Python: objects and names, results, and refused arguments."""

from __future__ import annotations

import gc
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from analysis import METRICS, Result, compare, load
from renderer import render
from renderer.trace import Renderer
from scenes.catalog import Look, load_seen
from scenes.catalog import load as load_scene
from tests.oracles.steps import read_limits
from tsar import POLICIES, ConfigError
from tsar.morton import raster_to_morton
from tsar.policies.framed import Framed

SMALL: dict[str, Any] = {
    "resolution_px": 64,
    "batch_size": 16,
    "warmup_cycles": 8,
    "reference_samples_per_axis": 1,
    "capacity": 8.7e10,
}


class Late(Framed):
    """The framed renderer, later."""

    latency_cycles = 3


def mean_difference(shown: torch.Tensor, reference: torch.Tensor) -> float:
    return float((shown - reference).mean())


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    out = tmp_path_factory.mktemp("compared")
    scene = load_scene("fly-by")
    return compare(scene, ["thesis", Late], [mean_difference], 0.2, out=out, image_times_s=[0.0, 0.11], **SMALL)


def test_a_result_has_a_row_a_run(result: Result) -> None:
    table = result.table()
    assert list(table.index) == ["thesis", "Late"] and np.isnan(table.loc["thesis", "ratio"])
    expected = result.errors["mse"].median("time_s").sel(run="Late")
    assert table.loc["Late", "mse"] == float(expected) > 0
    ratio = result.errors["mse"].sel(run="thesis") / result.errors["mse"].sel(run="Late")
    assert table.loc["Late", "ratio"] == pytest.approx(float(ratio.median()))
    assert table.loc["Late", "mean_difference"] == pytest.approx(
        float(result.errors["mean_difference"].sel(run="Late").mean())
    )


def test_images_are_those_of_the_times_asked_for(result: Result) -> None:
    images = result.images
    assert images.dims == ("run", "time_s", "row", "column", "channel") and images.shape == (3, 2, 64, 64, 3)
    assert list(images["run"].values) == ["thesis", "Late", "reference"]
    np.testing.assert_allclose(images["time_s"], [0.0, 0.1])
    from analysis.metrics.quality import pixel_errors

    for run in ("thesis", "Late"):
        for time_s in images["time_s"].values:
            shown, truth = (torch.from_numpy(images.sel(run=one, time_s=time_s).values) for one in (run, "reference"))
            assert pixel_errors(shown, truth)[0].mse == pytest.approx(
                float(result.errors["mse"].sel(run=run, time_s=time_s))
            )


def test_what_was_given_is_named_and_the_tables_are_as_before(result: Result) -> None:
    added = {
        one["name"]: one for one in json.loads((result.folder / "summary.json").read_text())["provenance"]["added"]
    }
    assert added.keys() == {"Late", "mean_difference"} and added["Late"]["module"] == __name__
    assert added["Late"]["distribution"] is None and added["Late"]["kind"] == "policy"
    assert "Late" not in POLICIES and "mean_difference" not in METRICS


def test_the_report_is_one_file(result: Result, tmp_path: Path) -> None:
    written = result.report(tmp_path / "deep" / "report.html")
    assert "Late" in written.read_text() and written.stat().st_size > 10_000


def test_a_finished_run_is_read_back(result: Result) -> None:
    found = load(result.folder)
    np.testing.assert_array_equal(found["mse"], result.errors["mse"])
    assert found.attrs["policy"] == "thesis" and json.loads(found.attrs["config"])["seconds"] == 0.2
    densities = found["density_spatial"]
    assert densities.dims == ("cycle", "row", "column") and densities.shape[1:] == (128, 128)
    assert (np.diff(found["cycle_time_s"]) > 0).all() and int(found["cycle"][0]) == -8
    limits = read_limits(result.folder / "steps.parquet")
    budget = (densities * found["density_temporal"]).sum(("row", "column")) + found["surplus"]
    np.testing.assert_allclose(budget, limits.budget, rtol=1e-5)


def test_fields_are_in_raster_order(result: Result) -> None:
    import pyarrow.parquet as pq

    stored = pq.read_table(result.folder / "steps.parquet", columns=["density_spatial"])["density_spatial"][-1]
    flat = stored.values.to_numpy()
    field = load(result.folder)["density_spatial"].values[-1]
    np.testing.assert_array_equal(field, flat[raster_to_morton(128).numpy()].reshape(128, 128))
    np.testing.assert_array_equal(field[:64, :64].mean(), flat[: 64 * 64].mean())  # the first quarter of the curve
    assert (field != flat.reshape(128, 128)).any()


def test_a_run_stands_beside_the_best_of_its_rivals() -> None:
    """Of one and of two frames of latency, both of which are in the summary."""
    metrics = ["ssim", mean_difference]
    found = compare("fly-by", ["framed-half", "framed", "framed-1"], metrics, 0.2, **SMALL)
    mse = {name: found.errors["mse"].sel(run=name).values for name in ("framed-half", "framed", "framed-1")}
    lowest = np.minimum(mse["framed"], mse["framed-1"])
    best, own = found.summary["best_rival"], mse["framed-half"]
    np.testing.assert_array_equal(best["mse"], lowest)
    assert best["ratio_statistics"].median == pytest.approx(np.median(own / lowest))
    assert best["metrics"]["mse"]["share"] == (own <= lowest).mean()
    assert best["metrics"]["mse"]["ratio"] == pytest.approx(np.median(own) / np.median(lowest))
    assert best["share_of_rivals"]["framed-1"] == (mse["framed-1"] <= mse["framed"]).mean() > 0
    ssim = found.errors["ssim"]
    most = ssim.sel(run=["framed", "framed-1"]).max("run")
    assert best["metrics"]["ssim"]["share"] == float((ssim.sel(run="framed-half") >= most).mean())
    assert set(best["metrics"]) == {"mse", "log_mse", "ssim", "mean_difference"}
    assert {"framed", "framed-1"} <= found.summary["ratio_statistics"].keys()
    assert "Beside the best rival" in (found.folder / "report.html").read_text()
    assert list(found.table().index) == list(mse)


def test_a_folder_of_its_own_goes_with_the_result() -> None:
    found = compare("fly-by", ["framed"], seconds=0.05, **SMALL)
    folder = found.folder
    assert (folder / "summary.json").is_file() and found.images.sizes["time_s"] == 3
    assert list(found.table().index) == ["framed"] and found.errors["mse"].shape == (1, 3)
    assert "density_spatial" not in load(folder)
    del found
    gc.collect()
    assert not folder.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"resolution": 64}, "^resolution: expected an option of a run, such as resolution_px$"),
        ({"policies": ["thesys"]}, "expected one of tsar, .*, framed, .*, got 'thesys' \\(nearest: thesis\\)"),
        ({"policies": []}, "policies: expected at least one"),
        ({"metrics": ["flp"]}, "metrics: expected one of flip, .*'flp'"),
        ({"scene": "flyby"}, "nearest: fly-by"),
        ({"image_times_s": [-1.0]}, "image_times_s: expected times from 0 s, got -1"),
        ({"batch_size": 0}, "batch_size"),
    ],
)
def test_what_is_wrong_is_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        compare(**{"scene": "fly-by", **arguments})


def test_a_picture_is_one_call() -> None:
    found = render("moving-object", (48, 32), samples_per_pixel=4)
    assert found.shape == (32, 48, 3) and found.dtype == np.float32 and 0.01 < found.mean() < 10.0
    np.testing.assert_array_equal(found, render(load_scene("moving-object"), (48, 32), samples_per_pixel=4, threads=1))
    assert (found != render("moving-object", (48, 32), samples_per_pixel=4, point_set="sobol")).any()
    with pytest.raises(ConfigError, match="point_set: expected one of"):
        render("glass", 32, point_set="soboll")
    with pytest.raises(ConfigError, match="size: expected at least one pixel, got 0"):
        render("glass", 0)


def test_policies_trace_paths_through_the_view_that_was_asked_for(tmp_path: Path) -> None:
    """Each run gets the radiance of paths, from the camera given; a sample of the framed renderer, too."""
    view: dict[str, Any] = {"camera": (4.0, -3.0, 2.0, 0.0, 0.0, 0.5), "bounces": 2}
    small: dict[str, Any] = {**SMALL, "reference_samples_per_axis": 2}
    found = compare("quad-light", ["tsar", "framed"], (), 0.1, out=tmp_path, integrator="path", **view, **small)
    scene, _ = load_seen("quad-light", Look(integrator="path", **view))
    assert scene.integrator.kind == "path" and scene.integrator.depth == 2
    expected = Renderer(scene, footprint_resolution_px=64).render_frame(0.0, 64, 64, 2).numpy()
    shown = found.images.isel(time_s=0)
    np.testing.assert_allclose(shown.sel(run="reference").values, expected, atol=1e-3)  # half precision on disk
    direct = Renderer(load_seen("quad-light", Look(**view))[0], footprint_resolution_px=64)
    assert np.abs(direct.render_frame(0.0, 64, 64, 2).numpy() - expected).mean() > 0.02
    for run in ("tsar", "framed"):
        assert shown.sel(run=run).values.mean() == pytest.approx(expected.mean(), rel=0.1)
    assert found.summary["config"]["integrator"] == "path" and not any(found.summary["nonfinite"].values())
