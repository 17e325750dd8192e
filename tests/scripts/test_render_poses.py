"""Films of models that do not move rigidly: each frame is that of its own time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from renderer.tables import materials
from scenes import catalog, models
from scenes.models import gltf_textures
from tests.scenes.models.files import QUAD_UVS
from tests.scenes.models.test_poses import channel, with_morphs
from tests.scripts.commands import call_script

SIZE = "--size", "48x32", "--samples-per-axis", "1"


def raised(folder: Path, height: float = 2.0) -> str:
    file = with_morphs(folder)
    channel(file, 0, "weights", [0.0, 1.0], np.array([0.0, 0.0, height, 0.0]))
    return str(file.written())


def content(folder: Path) -> list[bytes]:
    return [path.read_bytes() for path in sorted(folder.glob("frame*"))]


def depth(path: Path) -> np.ndarray:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return file.channels()["Z"].pixels


def test_frames_of_a_film_are_the_stills_of_their_times(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, tmp_path: Path
) -> None:
    model, film, still = raised(tmp_path), tmp_path / "film", tmp_path / "still"

    def run(out: Path, *more: str) -> tuple[list[bytes], str]:
        assert call_script("render.py", monkeypatch, model, *SIZE, *more, "--out", str(out)) == 0
        return content(out), capsys.readouterr().out

    frames, said = run(film, "--frames", "3", "--fps", "2")
    assert len(set(frames)) == 3 and "first frame: what does not move rigidly is read anew" in said
    for number, frame in enumerate(frames):
        (alone,), said = run(still, "--time-s", str(number / 2))
        assert alone == frame and f"the pose at {number / 2:g} s" in said and "anew" not in said
    # a key after the first frame changes: the frames that depend on it are rendered again
    raised(tmp_path, 1.0)
    again, said = run(film, "--frames", "3", "--fps", "2")
    assert "3 rendered now" in said and again[0] == frames[0] and again[1] != frames[1]


def test_layers_are_those_of_the_pose(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, tmp_path: Path
) -> None:
    view = "--camera", "0", "0", "9", "0", "0", "0", "--samples", "16", "--layers", "--format", "exr"
    model = raised(tmp_path)
    options = *view, *SIZE[:2], "--frames", "2", "--fps", "1", "--out", str(tmp_path / "out")
    assert call_script("render.py", monkeypatch, model, *options) == 0
    depths = [depth(path)[16, 24] for path in sorted((tmp_path / "out").glob("frame*"))]
    np.testing.assert_allclose(depths, [9.0, 7.0], atol=0.05)


@pytest.mark.parametrize("integrator", ["whitted", "path"])
def test_a_model_is_read_once(integrator: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    read: list[float] = []
    made: list[str] = []
    real, seen = models._read, catalog.load_seen
    monkeypatch.setattr(models, "_read", lambda *given: (read.append(given[4]), real(*given))[1])
    monkeypatch.setattr(catalog, "load_seen", lambda *given: (made.append(given[0]), seen(*given))[1])
    options = "--integrator", integrator, *SIZE, "--out", str(tmp_path / "out")
    assert call_script("render.py", monkeypatch, raised(tmp_path), *options) == 0
    assert read == [0.0] and len(made) == 1, "and its scene is made once"


@pytest.mark.parametrize("integrator", ["whitted", "path"])
def test_textures_are_made_once_for_all_frames(
    integrator: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Decoded once, and their mip maps made once, with the bytes of stills that are made alone."""
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (8, 8, 3), np.uint8)).save(tmp_path / "a.png")
    file = with_morphs(tmp_path)
    file.attribute("TEXCOORD_0", np.array(QUAD_UVS, np.float32))
    channel(file, 0, "weights", [0.0, 1.0], np.array([0.0, 0.0, 2.0, 0.0]))
    texture = {"index": file.texture("a.png")}
    file.material(pbrMetallicRoughness={"baseColorTexture": texture, "baseColorFactor": [1.0, 0.5, 1.0, 1.0]})
    model, made = str(file.written()), []

    def counted(place: object, name: str) -> None:
        real = getattr(place, name)
        monkeypatch.setattr(place, name, lambda *given: (made.append(name), real(*given))[1])

    counted(gltf_textures, "decoded")
    counted(materials, "mip_levels")

    def run(name: str, *more: str) -> list[bytes]:
        options = "--integrator", integrator, *SIZE, *more, "--out", str(tmp_path / name)
        assert call_script("render.py", monkeypatch, model, *options) == 0
        return content(tmp_path / name)

    frames = run("film", "--frames", "3", "--fps", "2")
    assert sorted(made) == ["decoded", "mip_levels"] and len(set(frames)) == 3
    models._kept.clear()
    assert run("still", "--time-s", "1") == frames[2:] and len(made) == 4
    Image.fromarray(np.zeros((8, 8, 3), np.uint8)).save(tmp_path / "a.png")
    assert run("dark", "--time-s", "1") != frames[2:] and len(made) == 6


def test_losses_of_later_frames_are_told_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, tmp_path: Path
) -> None:
    file = with_morphs(tmp_path)
    file.json["nodes"] = [{"mesh": 0}, {"mesh": 0, "name": "vanishing", "translation": [3, 0, 0]}]
    file.json["scenes"][0]["nodes"] = [0, 1]
    channel(file, 1, "scale", [0.0, 0.5], np.array([[1, 1, 1], [0, 0, 0]]))
    options = *SIZE, "--frames", "4", "--fps", "2", "--out", str(tmp_path / "out")
    assert call_script("render.py", monkeypatch, str(file.written()), *options) == 0
    said = capsys.readouterr().out
    assert said.count("vanishing: a node without extent") == 1 and said.count("that scales or shears") == 1


def test_images_that_can_change_have_their_mip_maps_made_anew() -> None:
    image = np.ones((4, 4, 3), np.float32)
    table = materials.MaterialTable("cpu")
    table.add_image(image, True)
    image[:] = 3.0
    again = materials.MaterialTable("cpu")
    again.add_image(image, True)
    assert table.texels[-1].tolist() == [[1.0, 1.0, 1.0]] and again.texels[-1].tolist() == [[3.0, 3.0, 3.0]]
