"""Runs of models that do not move rigidly: each moment shows its own pose."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from analysis.study.cases import SCALES, Case, MovingScene, content_of
from analysis.study.scenery import forget, render_reference, renderer
from renderer.film.files import read_exr
from renderer.posed import PosedRenderer
from renderer.trace import Renderer
from scenes.catalog import Look, load_seen
from scenes.models import files_of
from tests.scripts.commands import call_script
from tests.scripts.test_render_poses import depth, raised
from tsar.config import TsarConfig

CAMERA = 0.0, 0.0, 9.0, 0.0, 0.0, 0.0
VIEW = tuple(map(str, CAMERA))
SMALL = ("--resolution-px", "64", "--batch-size", "1", "--warmup-cycles", "4", "--seconds", "1")
PLAIN = (
    "--reference-samples-per-axis",
    "1",
    "--reference-rate-hz",
    "4",
    "--no-film",
    "--metrics",
    "--rivals",
    "framed",
)


@pytest.mark.slow
def test_a_run_shows_the_pose_of_each_moment(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, tmp_path: Path
) -> None:
    model, out = raised(tmp_path), tmp_path / "run"

    def run() -> tuple[str, dict]:
        where = "--layered-stills", "4", "--out", str(out), "--references", str(tmp_path / "kept")
        assert call_script("run.py", monkeypatch, model, *SMALL, *PLAIN, "--camera", *VIEW, *where) == 0
        return capsys.readouterr().out, json.loads((out / "summary.json").read_text())

    said, before = run()
    assert "those of the first time: what does not move rigidly is read anew 60 times a second; policies take" in said
    for number in range(4):
        still = tmp_path / f"still{number}"
        of = "--time-s", str(number / 4), "--size", "64x64", "--samples", "16", "--layers", "--format", "exr"
        assert call_script("render.py", monkeypatch, model, *of, "--camera", *VIEW, "--out", str(still)) == 0
        shown, alone = out / f"layers/reference-{number:06d}.exr", still / "frame00000.exr"
        assert np.array_equal(depth(shown), depth(alone)), "the depth is that of the pose"
        loaded, _ = load_seen(model, Look(camera=CAMERA, pose_s=number / 4))
        picture = Renderer(loaded, footprint_resolution_px=64.0).render_frame(number / 4, 64, 64, 1).numpy()
        assert np.array_equal(read_exr(shown), picture.astype(np.float16))
        assert depth(shown)[32, 32] == pytest.approx(9.0 - 2.0 * number / 4, abs=1e-3)
    # only a key after the first time changes
    raised(tmp_path, 1.0)
    _, after = run()
    assert before["provenance"]["content"] != after["provenance"]["content"]
    assert depth(out / "layers/reference-000003.exr")[32, 32] == pytest.approx(9.0 - 0.75, abs=1e-3)
    assert before["mse"] != after["mse"]


def test_a_study_has_the_poses_too(tmp_path: Path) -> None:
    model = raised(tmp_path)
    scale = SCALES["quick"].__class__(16, 1.0, 4.0, 1, 6)
    scene = MovingScene(model)
    found = render_reference(scene, 0.0, scale, tmp_path / "kept", 1)
    for number, image in enumerate(found.images):
        loaded, _ = load_seen(model, Look(pose_s=number / 4))
        expected = Renderer(loaded, threads=1, footprint_resolution_px=64.0).render_frame(number / 4, 64, 64, 1)
        assert np.array_equal(image, expected.numpy().astype(np.float16))
    assert isinstance(renderer(scene, 64.0, 1), PosedRenderer) and len(files_of(Path(model), False)) == 1
    key = Case(model, "framed", TsarConfig(batch_size=4, resolution_px=64), scale).key("source")
    raised(tmp_path, 1.0)
    forget()
    content_of.cache_clear()
    assert Case(model, "framed", TsarConfig(batch_size=4, resolution_px=64), scale).key("source") != key
    other = render_reference(scene, 0.0, scale, tmp_path / "kept", 1)
    assert np.array_equal(other.images[0], found.images[0]) and not np.array_equal(other.images[2], found.images[2])
