"""Files become arrays with the right values, or one line that names the file."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from scenes import loading, pictures
from scenes.canonical import SceneError
from scenes.loading import asset, clamp_radiance, read_image

BINARY = bytes(range(256)) * 8


def write_exr(path: Path, channels: dict[str, np.ndarray]) -> Path:
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(str(path))
    return path


def noise(height: int, width: int, channels: int = 3) -> np.ndarray:
    return np.random.default_rng(0).random((height, width, channels), dtype=np.float32) * 5.0


def decoded(code: int) -> float:
    """The sRGB transfer function."""
    value = code / 255.0
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


# --- pictures --------------------------------------------------------------------------------------------------------


def test_a_picture_is_read_once_and_again_when_it_changes(tmp_path: Path) -> None:
    """Edited in place, to the same length."""
    path = tmp_path / "a.ppm"
    path.write_bytes(b"P6\n1 1\n255\n" + bytes((255, 0, 0)))
    first = read_image(path)
    assert read_image(path) is first
    path.write_bytes(b"P6\n1 1\n255\n" + bytes((0, 255, 0)))
    assert read_image(path).tolist() == [[[0.0, 1.0, 0.0]]] and first.tolist() == [[[1.0, 0.0, 0.0]]]


def test_a_changed_asset_changes_the_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:

    from scenes.driving import sky

    before = sky.sky()
    assert sky.sky() is before
    shutil.copytree(loading.ASSETS, tmp_path / "assets")
    monkeypatch.setattr(loading, "ASSETS", tmp_path / "assets")
    height, width = read_image(asset("sky.exr")).shape[:2]
    write_exr(asset("sky.exr"), {"RGB": np.full((height, width, 3), 0.25, np.float32)})
    assert (sky.sky().image != before.image).any()


def test_png_is_decoded_to_linear_values(tmp_path: Path) -> None:
    codes = np.zeros((2, 3, 3), np.uint8)
    codes[0, 1], codes[1, 2] = (255, 128, 5), (10, 188, 64)
    Image.fromarray(codes).save(tmp_path / "a.png")
    found = read_image(tmp_path / "a.png")
    assert found.shape == (2, 3, 3) and found.dtype == np.float32
    expected = np.vectorize(decoded)(codes)
    assert found == pytest.approx(expected, abs=1e-6)
    assert found[1, 2, 1] == pytest.approx(0.5029, abs=1e-3)


@pytest.mark.parametrize("mode", ["L", "P", "RGBA"])
def test_other_kinds_of_png_become_rgb(tmp_path: Path, mode: str) -> None:
    # a grey that is also in the palette of the web
    Image.new("RGB", (4, 2), (153, 153, 153)).convert(mode).save(tmp_path / "a.png")
    found = read_image(tmp_path / "a.png")
    assert found.shape == (2, 4, 3) and found == pytest.approx(decoded(153), abs=1e-6)


def test_exr_is_read_as_it_is(tmp_path: Path) -> None:
    values = noise(3, 5)
    assert np.array_equal(read_image(write_exr(tmp_path / "a.exr", {"RGB": values})), values)
    four = noise(3, 5, 4)
    assert np.array_equal(read_image(write_exr(tmp_path / "b.EXR", {"RGBA": four})), four[..., :3])
    apart = {name: np.ascontiguousarray(values[..., place]) for place, name in enumerate("RGB")}
    assert np.array_equal(read_image(write_exr(tmp_path / "c.exr", apart)), values)


def test_pictures_are_shared_and_cannot_be_changed(tmp_path: Path) -> None:
    path = write_exr(tmp_path / "a.exr", {"RGB": noise(2, 2)})
    found = read_image(path)
    assert read_image(path) is found
    with pytest.raises(ValueError, match="read-only"):
        found[0, 0, 0] = 1.0


def broken_pictures(folder: Path) -> dict[str, Path]:
    """Files that no picture can be read from."""
    (folder / "whole.png").touch()
    Image.fromarray((noise(64, 64) * 50.0).astype(np.uint8)).save(folder / "whole.png")
    whole = (folder / "whole.png").read_bytes()
    exr = write_exr(folder / "whole.exr", {"RGB": noise(64, 64)}).read_bytes()
    holes = noise(2, 2)
    holes[1, 1, 2] = np.nan
    (folder / "folder.png").mkdir()
    contents = {
        "missing.png": None,
        "missing.exr": None,
        "folder.png": None,
        "empty.png": b"",
        "empty.exr": b"",
        "garbage.png": BINARY,
        "garbage.exr": BINARY,
        "half.png": whole[: len(whole) // 2],
        "half.exr": exr[: len(exr) // 2],
        "text.jpg": b"two lines\nof text\n",
    }
    for name, content in contents.items():
        if content is not None:
            (folder / name).write_bytes(content)
    write_exr(folder / "two.exr", {name: np.ones((2, 2), np.float32) for name in "RG"})
    write_exr(folder / "holes.exr", {"RGB": holes})
    return {name: folder / name for name in (*contents, "two.exr", "holes.exr")}


@pytest.mark.parametrize(
    "name",
    ["missing.png", "missing.exr", "folder.png", "empty.png", "empty.exr", "garbage.png", "garbage.exr", "half.png",
     "half.exr", "text.jpg", "two.exr", "holes.exr"],
)  # fmt: skip
def test_broken_pictures_are_named(tmp_path: Path, name: str) -> None:
    path = broken_pictures(tmp_path)[name]
    with pytest.raises(SceneError) as caught:
        read_image(path)
    message = str(caught.value)
    assert message.startswith(f"texture {path}: ") and "\n" not in message and len(message) > len(str(path)) + 12


@pytest.mark.parametrize("ending", [".png", ".exr"])
def test_pictures_too_large_for_memory_are_refused_before_they_are_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, recwarn: pytest.WarningsRecorder, ending: str
) -> None:
    if ending == ".png":  # 22 kB that would take 5 GB
        path = tmp_path / "bits.png"
        Image.new("1", (12000, 12000)).save(path)
        size = "12000 x 12000"
    else:
        path, size = tmp_path / "wide.exr", "3 x 2"
        write_exr(path, {"RGB": np.zeros((2, 3, 3), np.float32)})
        monkeypatch.setattr(pictures, "PIXELS_MOST", 5)
    monkeypatch.setattr(loading, "decode_srgb", lambda encoded: pytest.fail("decoded"))
    with pytest.raises(SceneError, match=rf"expected at most .* pixels, got {size}"):
        read_image(path)
    assert not recwarn.list


def test_assets_are_found_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert asset("sky.exr").is_file()
    monkeypatch.setattr(loading, "ASSETS", tmp_path)
    with pytest.raises(SceneError, match=r"^asset 'sky\.exr': expected a file at .*sky\.exr, found none$") as caught:
        asset("sky.exr")
    assert str(tmp_path) in str(caught.value)


# --- radiance --------------------------------------------------------------------------------------------------------


@given(st.lists(st.tuples(*[st.floats(0.0, 1e5, width=32)] * 3), min_size=1), st.floats(0.5, 100.0))
def test_clamping_keeps_hue_and_never_brightens(texels: list[tuple[float, ...]], limit: float) -> None:
    image = np.array(texels, np.float32).reshape(1, -1, 3)
    found = clamp_radiance(image, limit)
    assert found.dtype == np.float32 and found.shape == image.shape
    assert (found <= image * (1.0 + 1e-6)).all() and found.max() <= limit * (1.0 + 1e-6)
    peak, after = image.max(axis=-1, keepdims=True), found.max(axis=-1, keepdims=True)
    assert found * peak == pytest.approx(image * after, rel=1e-4, abs=1e-30), "the channels keep their proportion"
    kept = peak[..., 0] <= limit
    assert np.array_equal(found[kept], image[kept]), "what is below the limit stays"
    assert after[..., 0][~kept] == pytest.approx(limit, rel=1e-5)
