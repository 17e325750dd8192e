"""A small comparison from end to end, and one line for whatever cannot be run."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

import analysis.storage.reference
from analysis.command import cli
from analysis.command.cli import InputError
from analysis.comparison.experiment import RunOptions, run_experiment
from analysis.comparison.setup import prepare
from analysis.storage.files import plain
from renderer.film.files import read_exr
from scenes import loading
from tests.scripts.commands import call_script, nothing_in, one_line, run_script
from tsar.config import TsarConfig

BATCH, SIDE, IMAGES = 16, 64, 5
SIZE = ("--resolution-px", str(SIDE), "--batch-size", str(BATCH), "--warmup-cycles", "8", "--capacity", "3e10")
SPAN = ("--seconds", "0.25", "--reference-samples-per-axis", "1", "--reference-rate-hz", "20")
THESIS = ("--policy", "thesis", "--rivals", "framed", "framed-super")


def options(folder: Path, out: str, threads: int) -> RunOptions:
    """The same run as :data:`SIZE` and :data:`SPAN` ask for."""
    return RunOptions(
        input="fly-by",
        tsar=TsarConfig(batch_size=BATCH, resolution_px=SIDE, warmup_cycles=8),
        capacity=3e10,
        policy="thesis",
        rivals=("framed", "framed-super"),
        seconds=0.25,
        reference_samples_per_axis=1,
        reference_rate_hz=20.0,
        threads=threads,
        film=False,
        out=folder / out,
        references=folder / "cache",
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run")


@pytest.fixture(scope="module")
def done(folder: Path) -> subprocess.CompletedProcess[str]:
    """A run in a process of its own; its results lie in ``out``."""
    where = ("--threads", "2", "--write-frames", "--out", "out", "--references", "cache")
    done = run_script("run.py", folder, "fly-by", *SIZE, *SPAN, *THESIS, *where)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done


@pytest.fixture(scope="module")
def printed(done: subprocess.CompletedProcess[str]) -> str:
    """What the run prints."""
    return done.stdout


@pytest.fixture(scope="module")
def summary(folder: Path, printed: str) -> dict[str, Any]:
    return json.loads((folder / "out" / "summary.json").read_text())


@pytest.fixture(scope="module")
def again(folder: Path, printed: str) -> Iterator[tuple[dict[str, Any], int]]:
    """Summary of the run on one thread, and how many reference images it rendered."""
    rendered = []
    obtain = analysis.storage.reference.obtain

    def counting(*arguments: Any) -> Any:
        found = obtain(*arguments)
        rendered.append(found.rendered)
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(analysis.storage.reference, "obtain", counting)
        found = run_experiment(options(folder, "again", threads=1))
    assert len(rendered) == 1
    yield plain(found), rendered[0]


# --- a run -----------------------------------------------------------------------------------------------------------


def test_every_result_is_there(folder: Path, printed: str) -> None:
    found = sorted(path.name for path in (folder / "out").iterdir())
    files = {"comparison.mp4", "error.png", "error.svg", "report.html", "steps.parquet", "summary.json"}
    assert set(found) == files | {"files.journal", "frames"}
    assert all(name in printed for name in files)
    assert f"look at it: {(folder / 'out' / 'report.html').as_uri()}" in printed
    with Image.open(folder / "out" / "error.png") as picture:
        assert min(picture.size) > 200
    page = (folder / "out" / "report.html").read_text()
    assert "fly-by" in page and page.rstrip().endswith("</html>")


def test_frames_are_what_the_display_shows(folder: Path, printed: str) -> None:
    frames = sorted((folder / "out" / "frames").iterdir())
    assert [frame.name for frame in frames] == [f"{number:06d}.exr" for number in range(IMAGES)]
    images = np.stack([read_exr(frame) for frame in frames])
    assert images.shape == (IMAGES, SIDE, SIDE, 3) and np.isfinite(images).all() and images.std() > 0.01
    assert np.abs(images[1:] - images[:-1]).max() > 0.0


def test_the_film_has_a_frame_of_every_reference_time(folder: Path, printed: str) -> None:
    import av

    with av.open(str(folder / "out" / "comparison.mp4")) as film:
        assert sum(1 for _ in film.decode(video=0)) == IMAGES


def test_errors_are_given_at_every_reference_time(summary: dict[str, Any]) -> None:
    assert summary["reference_time_s"] == pytest.approx(np.arange(IMAGES) / 20.0)
    adaptive, framed = np.array(summary["mse"]["thesis"]), np.array(summary["mse"]["framed"])
    assert adaptive.shape == framed.shape == (IMAGES,) and (adaptive > 0.0).all() and (framed > 0.0).all()
    assert summary["ratio"] == pytest.approx(adaptive / framed)
    assert max(adaptive.max(), framed.max()) < 0.1, "both resemble the reference"
    assert summary["ratio_median"] == pytest.approx(float(np.median(summary["ratio"])))
    assert 0.0 <= summary["suitable_percentile"] <= 100.0


def test_work_is_accounted_for(summary: dict[str, Any], folder: Path) -> None:
    cycles = summary["cycles"]
    assert 20 <= cycles <= 60 and summary["warmup_cycles"] == 8
    assert summary["samples_traced"] == cycles * BATCH * 256
    assert pq.ParquetFile(folder / "out" / "steps.parquet").metadata.num_rows == cycles + 8
    stages = {"selection", "tracing", "error", "response", "tiling", "reconstruction"}
    assert stages <= set(summary["stage_wall_s"]) and stages == set(summary["stage_flops"])
    assert min(summary["stage_wall_s"].values()) > 0.0
    assert sum(summary["stage_flops"].values()) == pytest.approx(cycles * summary["cycle_s"] * 3e10)


def test_how_long_each_part_took_is_told(done: subprocess.CompletedProcess[str]) -> None:
    for part, count in (("reference", IMAGES), ("comparison", IMAGES), ("film", None)):
        assert re.search(
            rf"(?m)^{part} .* {count or '[0-9]+'}/{count or '[0-9]+'} +[0-9]+:[0-9]{{2}}:[0-9]{{2}} ", done.stderr
        ), part


def test_the_time_to_the_first_cycle_is_told(
    done: subprocess.CompletedProcess[str], summary: dict[str, Any], again: tuple[dict[str, Any], int]
) -> None:
    told = re.findall(r"^first cycle after ([0-9.]+) s$", done.stderr, re.MULTILINE)
    found = summary["start"]["first_cycle_s"]
    assert len(told) == 1 and float(told[0]) == pytest.approx(found, abs=0.006)
    assert 0.0 < again[0]["start"]["first_cycle_s"] < 60.0, "from the call where no process start is given"


def test_the_first_cycle_does_not_wait_for_the_reference(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    def obtain(*arguments: Any) -> None:
        raise ValueError("no room for the reference")

    monkeypatch.setattr(analysis.storage.reference, "obtain", obtain)
    with pytest.raises(InputError, match="no room for the reference"):
        run_experiment(options(tmp_path, "out", threads=1))
    assert "first cycle after" in capsys.readouterr().err and nothing_in(tmp_path / "out")


def test_invariants_hold(summary: dict[str, Any]) -> None:
    assert summary["invariants"]["ok"] is True and summary["invariants"]["cycles"] == summary["cycles"] + 8
    assert set(summary["nonfinite"].values()) == {0}


def test_provenance_tells_where_it_comes_from(summary: dict[str, Any]) -> None:
    source = summary["provenance"]
    assert {"python", "torch", "warp-lang", "numpy"} <= set(source["versions"]) and all(source["versions"].values())
    expected = {"seed": 0, "device": "cpu", "threads": 2, "scene": "fly-by"}
    assert {name: source[name] for name in expected} == expected
    assert isinstance(source["commit"], str) and len(source["config_hash"]) == 16
    assert summary["config"]["tsar"]["batch_size"] == BATCH and summary["config"]["write_frames"] is True


def test_the_table_shows_the_summary(printed: str, summary: dict[str, Any]) -> None:
    assert f"{summary['ratio_median']:.3f}" in printed and f"{summary['samples_traced']:,}" in printed
    assert "hold in every cycle" in printed


def test_threads_change_nothing(summary: dict[str, Any], again: tuple[dict[str, Any], int]) -> None:
    """On one thread and on two every error is the same to the last bit."""
    other, _ = again
    assert (summary["provenance"]["threads"], other["provenance"]["threads"]) == (2, 1)
    for name in ("mse", "log_mse", "counters", "refresh_s", "images"):
        assert other[name] == summary[name], name


def test_the_reference_is_rendered_once(folder: Path, again: tuple[dict[str, Any], int]) -> None:
    _, rendered = again
    assert rendered == 0
    images = [np.load(path, mmap_mode="r") for path in (folder / "cache").glob("*.npy")]
    assert [found.shape for found in images] == [(IMAGES, SIDE, SIDE, 3)]


def test_options_leave_out_what_they_say(folder: Path, again: tuple[dict[str, Any], int]) -> None:
    assert not (folder / "again" / "comparison.mp4").exists() and not (folder / "again" / "frames").exists()
    assert json.loads((folder / "again" / "summary.json").read_text()) == again[0]
    named = {*again[0]["files"], "summary.json", "files.journal", ".owner"}
    assert named == {path.name for path in (folder / "again").iterdir()}, "no file is named that was not written"


# --- what cannot be run ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "part"),
    [(("nonsense", *SIZE), "'nonsense'"), (("fly-by", "--batch-size", "-1"), "batch_size")],
)
def test_bad_input_of_a_process_of_its_own(arguments: tuple[str, ...], part: str, tmp_path: Path) -> None:
    done = run_script("run.py", tmp_path, *arguments, "--out", "out", "--references", "cache")
    assert done.returncode == 2 and done.stdout == "" and one_line(done.stderr), done.stderr
    assert part in done.stderr and not any(tmp_path.iterdir())


@pytest.mark.parametrize("what", ["out", "references"])
def test_folders_that_cannot_be_written(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    (tmp_path / "file").write_text("kept")
    places = {"out": tmp_path / "out", "references": tmp_path / "references", what: tmp_path / "file" / "below"}
    where = [part for name, path in places.items() for part in (f"--{name}", str(path))]
    status = call_script("run.py", monkeypatch, "fly-by", *SIZE, *where)
    shown = capsys.readouterr()
    assert status == 2 and shown.out == "" and one_line(shown.err), shown.err
    assert shown.err.startswith(f"error: {what}: cannot write to ") and str(tmp_path / "file") in shown.err
    assert (tmp_path / "file").read_text() == "kept" and nothing_in(tmp_path / "out")


def test_a_resolution_beyond_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(cli, "free_memory_bytes", lambda: 2 * 2**30)
    where = ("--out", str(tmp_path / "out"), "--references", str(tmp_path / "cache"))
    status = call_script("run.py", monkeypatch, "fly-by", "--resolution-px", "8192", *where)
    shown = capsys.readouterr()
    assert status == 2 and shown.out == "" and one_line(shown.err), shown.err
    assert "resolution_px: 8192 needs about" in shown.err and "2.0 GiB are free" in shown.err
    assert nothing_in(tmp_path / "out")


@pytest.mark.parametrize("broken", ["pavement_albedo_512.png", "sky.exr", "landscape_band.jpg"])
def test_an_unreadable_texture_is_named(broken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assets = tmp_path / "assets"
    shutil.copytree(loading.ASSETS, assets)
    (assets / broken).write_bytes(b"not a picture" * 20)
    monkeypatch.setattr(loading, "ASSETS", assets)
    with pytest.raises(InputError) as caught:
        prepare(options(tmp_path, "out", threads=1))
    message = str(caught.value)
    assert message.startswith(f"texture {assets / broken}: ") and "\n" not in message
    assert not (tmp_path / "out").exists()


def test_help_names_the_options(tmp_path: Path) -> None:
    done = run_script("run.py", tmp_path, "--help")
    assert done.returncode == 0 and done.stderr == ""
    for name in ("--seconds", "--ledger", "--capacity", "--batch-size", "--resolution-px", "--solver", "--out"):
        assert name in done.stdout
    assert "Framelets rendered per cycle." in done.stdout and nothing_in(tmp_path)
    assert done.stdout.splitlines()[0].endswith(" INPUT"), "an argument is called by what it is, not by its type"


@pytest.mark.parametrize("name", ["planescene", "spheresscene", "quad-light"])
def test_other_built_in_scenes_run_too(name: str, tmp_path: Path, monkeypatch, capsys) -> None:
    """Block scenes of the motion-blur study, and one with lamps, whose samples draw random numbers."""
    where = (*THESIS, "--no-film", "--out", str(tmp_path / "out"), "--references", str(tmp_path / "cache"))
    assert call_script("run.py", monkeypatch, name, *SIZE, *SPAN, *where) == 0, capsys.readouterr().err
    shown = capsys.readouterr().out
    assert "hold in every cycle" in shown and "MSE, median" in shown and "JOD, higher" in shown
