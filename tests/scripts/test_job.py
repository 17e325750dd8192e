"""Jobs: all combinations, resumed where they stopped."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from renderer.frames import render_image
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from scenes import catalog
from scenes.formats.blocks.read import load_blocks
from tests.scripts.commands import assert_refused, call_script, nothing_in

JOB = "Spheres_scene\n2\n1 8\n2\nhammersley stratifiedmc\n1\nbox\n"


@pytest.fixture
def job(tmp_path: Path) -> Path:
    path = tmp_path / "job.txt"
    path.write_text(JOB)
    return path


def summary(folder: Path) -> dict:
    return json.loads((folder / "summary.json").read_text())


def test_a_job_renders_every_combination_once(job: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    out = tmp_path / "out"
    size = ("--width-px", "24", "--first-frame", "100", "--out", str(out))
    assert call_script("job.py", monkeypatch, str(job), "--frames", "1", *size) == 0
    rows = summary(out)["rows"]
    assert [row["combination"] for row in rows] == [
        f"{name}-box-{level:04d}" for level in (1, 8) for name in ("hammersley", "stratified")
    ]
    assert all(row["rendered_now"] == 1 and row["nonfinite"] == 0 for row in rows)
    file = out / "stratified-box-0008" / "frame00100.png"
    before = file.stat().st_mtime_ns
    assert call_script("job.py", monkeypatch, str(job), "--frames", "2", *size) == 0
    assert [row["rendered_now"] for row in summary(out)["rows"]] == [1] * 4  # the other frame alone
    assert file.stat().st_mtime_ns == before
    assert call_script("job.py", monkeypatch, str(job), "--frames", "1", "--seed", "1", *size) == 0
    assert [row["rendered_now"] for row in summary(out)["rows"]] == [1] * 4  # of another job
    assert "4 combinations" in capsys.readouterr().out


def test_a_frame_is_that_of_its_plan_over_its_time(job: Path, tmp_path: Path, monkeypatch) -> None:
    out = tmp_path / "out"
    options = ("--width-px", "24", "--first-frame", "90", "--frames", "1", "--format", "png")
    assert call_script("job.py", monkeypatch, str(job), *options, "--out", str(out)) == 0
    scene, settings = load_blocks(catalog.blur_scene_file("spheresscene"))
    renderer = Renderer(scene)
    plan = SamplePlan(8, "hammersley", 0, "gaussian", 0.5, "box", 0.5)
    image = render_image(renderer, plan, 24, 24, settings.frame_start_s(90), (0.0, 1.0 / 30.0), 90)
    renderer.close()
    from renderer.film.files import encode_srgb

    with Image.open(out / "hammersley-box-0008" / "frame00090.png") as found:
        assert np.array_equal(np.asarray(found), encode_srgb(image))


@pytest.mark.parametrize(
    ("text", "options", "parts"),
    [
        (JOB.replace("1 8", "1 9"), (), ("expected cubes", "9")),
        (JOB.replace("Spheres_scene", "night"), (), ("scene: expected a block file or one of planescene",)),
        (JOB, ("--scene", "gone.txt"), ("gone.txt", "cannot be read")),
        (JOB, ("--first-frame", "300"), ("frames", "210", "300")),
    ],
)
def test_bad_input(text, options, parts, job: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    job.write_text(text)
    status = call_script("job.py", monkeypatch, str(job), *options, "--out", str(tmp_path / "out"))
    assert_refused(status, capsys, parts)
    assert nothing_in(tmp_path / "out")
