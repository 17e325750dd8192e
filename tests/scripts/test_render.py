"""Stills, sequences that continue where they stopped, and films."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import analysis.storage.source
from renderer.film.files import read_exr
from tests.scripts.commands import call_script, one_line, run_script

MESH = """
v -1 -1 0
v 1 -1 0
v 1 1 1
v -1 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
f 1/1 2/2 3/3
f 1/1 3/3 4/4
"""
SCENE = """<scene version="0.5.0"><integrator type="direct"/><sensor type="perspective"><float name="fov" value="40"/>
<transform name="toWorld"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="160"/><integer name="height" value="120"/></film></sensor>
<shape type="obj"><string name="filename" value="cube.obj"/><boolean name="faceNormals" value="true"/>
<bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string name="filename" value="paint.png"/></texture>
</bsdf></shape><include filename="lamp.xml"/></scene>"""
CUBE = Path(__file__).parents[1] / "scenes" / "models" / "cases" / "cube-without-normals.gltf"
SKY = bytes((128, 128, 128, 127)) * 2 + bytes((32, 32, 32, 127)) * 2
"""Four pixels of a Radiance picture: 0.25 above, 0.0625 below."""
SIZE = ("--width-px", "48", "--height-px", "32", "--samples-per-axis", "1")


def stills(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("frame*"))


def summary(folder: Path) -> dict:
    return json.loads((folder / "summary.json").read_text())


def picture(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image)


@pytest.fixture
def render(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, tmp_path: Path):
    """Runs the script on the folder ``out``; returns how many frames were rendered now."""

    def run(*arguments: str) -> int:
        status = call_script("render.py", monkeypatch, *arguments, "--out", str(tmp_path / "out"))
        shown = capsys.readouterr()
        assert status == 0, shown.err
        found = re.search(r"^\d+ frames \((\d+) rendered now, 0 values not finite\) in ", shown.out, re.MULTILINE)
        assert found is not None, shown.out
        return int(found[1])

    return run


def test_a_still_in_a_process_of_its_own(tmp_path: Path) -> None:
    done = run_script("render.py", tmp_path, "fly-by", *SIZE, "--time-s", "1", "--out", "out")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("1 frames (1 rendered now, 0 values not finite)")
    out = tmp_path / "out"
    assert sorted(path.name for path in out.iterdir()) == ["files.journal", "frame00000.png", "summary.json"]
    pixels = picture(out / "frame00000.png")
    assert pixels.shape == (32, 48, 3) and pixels.dtype == np.uint8 and pixels.std() > 10.0
    found = summary(out)
    assert found["frames"] == found["rendered_now"] == 1 and found["config"]["time_s"] == 1.0
    assert found["provenance"]["scene"] == "fly-by" and found["provenance"]["versions"]["torch"]


def test_a_film_goes_on_where_it_stopped(render, tmp_path: Path) -> None:
    import av

    arguments = ("approach", *SIZE, "--frames", "3", "--format", "mp4", "--fps", "10")
    out = tmp_path / "out"
    assert render(*arguments) == 3
    assert stills(out) == ["frame00000.png", "frame00001.png", "frame00002.png"]
    before = {name: ((out / name).read_bytes(), os.stat(out / name).st_mtime_ns) for name in stills(out)}
    assert len({content for content, _ in before.values()}) == 3
    (out / "frame00001.png").unlink()
    (out / "film.mp4").unlink()
    assert render(*arguments) == 1
    after = {name: ((out / name).read_bytes(), os.stat(out / name).st_mtime_ns) for name in stills(out)}
    assert after["frame00000.png"] == before["frame00000.png"] and after["frame00002.png"] == before["frame00002.png"]
    assert after["frame00001.png"][0] == before["frame00001.png"][0], "the same picture again"
    assert summary(out)["rendered_now"] == 1
    with av.open(str(out / "film.mp4")) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(frames) == 3 and frames[0].shape == (32, 48, 3)
    for number, frame in enumerate(frames):
        shown = picture(out / f"frame{number:05d}.png").astype(float)
        assert np.abs(frame.astype(float) - shown).mean() < 8.0


def test_a_longer_sequence_of_the_same_job_keeps_what_is_there(render, tmp_path: Path) -> None:
    assert render("chase", *SIZE) == 1
    assert render("chase", *SIZE, "--frames", "2", "--threads", "1") == 1
    assert stills(tmp_path / "out") == ["frame00000.png", "frame00001.png"]


@pytest.mark.parametrize(
    "other",
    [("chase", *SIZE), ("fly-by", *SIZE, "--time-s", "1"), ("fly-by", "--width-px", "32", "--height-px", "32"),
     ("fly-by", *SIZE, "--phase", "0.5")],
)  # fmt: skip
def test_another_job_replaces_the_stills(render, tmp_path: Path, other: tuple[str, ...]) -> None:
    out = tmp_path / "out"
    assert render("fly-by", *SIZE, "--frames", "2") == 2
    before = (out / "frame00000.png").read_bytes()
    assert render(*other) == 1
    assert stills(out) == ["frame00000.png"], "none of the other job is left"
    assert (out / "frame00000.png").read_bytes() != before


def test_an_edited_scene_gives_the_new_picture_beside_the_users_own_files(render, tmp_path: Path) -> None:
    """Scene file, mesh, texture and included file keep their names."""
    out, picture_file = tmp_path / "out", tmp_path / "paint.png"
    scene, mesh, part = tmp_path / "in.xml", tmp_path / "cube.obj", tmp_path / "lamp.xml"
    scene.write_text(SCENE)
    mesh.write_text(MESH)
    part.write_text('<scene version="0.5.0"><emitter type="directional"><vector name="direction" x="-0.4" y="-0.6" '
                    'z="-1"/><rgb name="irradiance" value="2.5 2.5 2.5"/></emitter></scene>')  # fmt: skip
    Image.new("RGB", (2, 2), (200, 100, 50)).save(picture_file)
    out.mkdir()
    for name in ("frame-notes.md", "frames.csv"):
        (out / name).write_text("mine")
    arguments = (str(scene), *SIZE)
    assert render(*arguments) == 1 and render(*arguments) == 0
    seen = {picture(out / "frame00000.png").tobytes()}
    Image.new("RGB", (2, 2), (50, 100, 200)).save(picture_file)
    edits = {part: ("2.5 2.5 2.5", "1 2 3"), mesh: ("v 1 1 1", "v 1 2 1"), scene: ('value="40"', 'value="50"')}
    for file, (old, new) in {picture_file: ("", ""), **edits}.items():
        if old:
            file.write_text(file.read_text().replace(old, new))
        assert render(*arguments) == 1 and render(*arguments) == 0
        seen.add(picture(out / "frame00000.png").tobytes())
        assert len(seen) == 2 + [picture_file, *edits].index(file), f"{file} was edited"
    assert all((out / name).read_text() == "mine" for name in ("frame-notes.md", "frames.csv"))


def test_an_upgraded_renderer_renders_again(render, monkeypatch: pytest.MonkeyPatch) -> None:
    assert render("plain", *SIZE) == 1 and render("plain", *SIZE) == 0
    real = analysis.storage.source.version_of
    monkeypatch.setattr(analysis.storage.source, "version_of", lambda name: "9" if name == "warp" else real(name))
    assert render("plain", *SIZE) == 1 and render("plain", *SIZE) == 0


@pytest.mark.parametrize(
    "arguments",
    [("--samples", "4"), ("--samples-per-axis", "2"), ("--environment", "sky.hdr", "--up", "z", "--samples", "4")],
)
def test_a_model_is_rendered_whole_and_in_part(
    render, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...]
) -> None:
    """A plain model in the middle of its picture, or lit by a Radiance picture; a crop is the same part of the
    picture."""
    (tmp_path / "sky.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 2\n" + SKY)
    monkeypatch.chdir(tmp_path)
    arguments = (str(CUBE), "--size", "80x60", *arguments)
    assert render(*arguments) == 1
    whole = picture(tmp_path / "out" / "frame00000.png")
    assert whole.shape == (60, 80, 3)
    middle, corner = whole[20:40, 30:50].astype(float), whole[:6, :6].astype(float)
    assert np.abs(middle.mean() - corner.mean()) > 5.0 and middle.mean() > 20.0
    if "sky.hdr" in arguments:
        assert 60 < corner.min() <= corner.max() < 140  # sRGB of 0.0625 to 0.25
    assert render(*arguments, "--crop", "30", "20", "25", "20") == 1
    np.testing.assert_array_equal(picture(tmp_path / "out" / "frame00000.png"), whole[20:40, 30:55])


def test_faces_without_normals_have_one_shade_each(render, tmp_path: Path) -> None:
    """Two faces of a cube and the background: three colours, but for pixels that edges cross."""
    assert render(str(CUBE), "--size", "96x96", "--samples", "4", "--space-filter", "box") == 1
    colors = picture(tmp_path / "out" / "frame00000.png").reshape(-1, 3)
    counts = np.unique(colors, axis=0, return_counts=True)[1]
    assert np.sort(counts)[-3:].sum() > 0.95 * 96 * 96 and np.sort(counts)[-3] > 2000


def test_a_camera_straight_above_gives_a_picture(render, tmp_path: Path) -> None:
    assert render(str(CUBE), "--camera", "0", "9", "0", "0", "0", "0", *SIZE) == 1
    assert picture(tmp_path / "out" / "frame00000.png").std() > 1.0


def test_the_film_of_a_scene_file_is_obeyed(render, tmp_path: Path) -> None:
    (tmp_path / "cube.obj").write_text(MESH)
    (tmp_path / "lamp.xml").write_text('<scene version="0.5.0"/>')
    Image.new("RGB", (2, 2), (200, 100, 50)).save(tmp_path / "paint.png")
    (tmp_path / "in.xml").write_text(SCENE)
    assert render(str(tmp_path / "in.xml")) == 1
    assert picture(tmp_path / "out" / "frame00000.png").shape == (120, 160, 3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(("--size", "800"), "size: expected such as 800x600, got '800'"), (("--size", "0x9"), "size: expected sides"),
     (("--size", "9x9", "--width-px", "9"), "size: expected none together with width_px and height_px"),
     (("--size", "9x9", "--crop", "5", "5", "5", "4"), "crop: expected a part of 9 x 9 pixels"),
     (("--environment", "gone.hdr"), "gone.hdr: cannot be read (No such file or directory)"),
     (("--camera", "0", "0", "0", "0", "0", "0"), "expected finite points that differ")],
)  # fmt: skip
def test_looks_that_cannot_be(
    arguments: tuple[str, ...], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    status = call_script("render.py", monkeypatch, "plain", *arguments, "--out", str(tmp_path / "out"))
    shown = capsys.readouterr()
    assert status == 2 and one_line(shown.err) and message in shown.err


def test_exr_is_linear_and_png_its_encoding(render, tmp_path: Path) -> None:
    render("fly-by", *SIZE, "--format", "exr")
    render("fly-by", *SIZE)
    linear = np.clip(read_exr(tmp_path / "out" / "frame00000.exr"), 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    shown = picture(tmp_path / "out" / "frame00000.png") / 255.0
    assert np.abs(shown - encoded).max() < 2.5 / 255.0


def test_a_file_in_place_of_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    (tmp_path / "file").touch()
    status = call_script("render.py", monkeypatch, "fly-by", "--out", str(tmp_path / "file" / "below"))
    shown = capsys.readouterr()
    assert status == 2 and one_line(shown.err) and "out: cannot write to" in shown.err


def test_help_names_the_options(tmp_path: Path) -> None:
    done = run_script("render.py", tmp_path, "--help")
    assert done.returncode == 0 and done.stderr == ""
    for name in ("--width-px", "--samples-per-axis", "--frames", "--format", "--phase", "--out"):
        assert name in done.stdout
