"""Pictures of every kind are what their files say."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from scenes.canonical import SceneError
from scenes.loading import is_linear, read_image
from tests.scenes.formats.files import CASES

FOLDER = CASES / "picture-files"


def decoded(value: float) -> float:
    """The sRGB transfer function."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


@pytest.mark.parametrize("name", ["a.hdr", "a.pfm"])
def test_radiance_and_float_maps_are_linear(name: str) -> None:
    found = read_image(FOLDER / name)
    assert found.shape == (4, 8, 3) and is_linear(FOLDER / name)
    assert found[0, 0] == pytest.approx([10.0, 20.0, 30.0])
    rest = found.reshape(-1, 3)[1:]
    assert (rest[:-1] == 3.5).all()
    assert rest[-1] == pytest.approx([0.1, 0.2, 0.3], rel=0.005)  # bottom right


def test_grey_of_16_bits_and_floating_point_tiff() -> None:
    grey, number = read_image(FOLDER / "g16.png"), read_image(FOLDER / "f32.tif")
    assert grey == pytest.approx(np.full((4, 4, 3), decoded(30000 / 65535)), rel=1e-5)
    assert (number == 0.5).all() and is_linear(FOLDER / "f32.tif") and not is_linear(FOLDER / "g16.png")


def test_a_single_channel_of_openexr_is_grey(tmp_path: Path) -> None:
    values = np.random.default_rng(0).random((4, 6), np.float32)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": values}).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), np.repeat(values[..., None], 3, axis=-1))


def test_all_of_a_16_bit_ramp_is_told_apart(tmp_path: Path) -> None:
    ramp = np.linspace(0, 65535, 256).astype(np.uint16)[None]
    Image.fromarray(ramp).save(tmp_path / "a.png")
    expected = [decoded(value / 65535.0) for value in ramp[0].tolist()]
    np.testing.assert_allclose(read_image(tmp_path / "a.png")[0, :, 1], expected, rtol=1e-5, atol=1e-7)


def tiff(values: np.ndarray, order: str, packing: int) -> bytes:
    """A picture of floating-point numbers in one strip, written by hand after TIFF 6.0."""
    height, width, samples = values.shape
    body = values.astype(f"{order}f{values.itemsize}").tobytes()
    body = zlib.compress(body) if packing == 8 else body
    entries = [(256, 4, width), (257, 4, height), (258, 3, 8 * values.itemsize), (259, 3, packing), (262, 3, 2),
               (273, 4, 0), (277, 3, samples), (278, 4, height), (279, 4, len(body)), (339, 3, 3)]  # fmt: skip
    start = 8 + 2 + 12 * len(entries) + 4
    made = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(f"{order}IH", 8, len(entries))
    for tag, kind, value in entries:
        value = start if tag == 273 else value
        made += struct.pack(f"{order}HHI", tag, kind, 1)
        made += struct.pack(f"{order}I", value) if kind == 4 else struct.pack(f"{order}HH", value, 0)
    return made + struct.pack(f"{order}I", 0) + body


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("packing", [1, 8])
@pytest.mark.parametrize(("kind", "samples"), [(np.float32, 3), (np.float16, 4), (np.float64, 1)])
def test_tiff_of_floating_point_numbers(order: str, packing: int, kind: type, samples: int, tmp_path: Path) -> None:
    values = (np.random.default_rng(0).random((3, 5, samples)) * 20.0).astype(kind)
    (tmp_path / "a.tif").write_bytes(tiff(values, order, packing))
    expected = values[..., :3] if samples >= 3 else np.repeat(values, 3, axis=-1)
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), expected.astype(np.float32))


def radiance(rows: bytes, width: int, height: int, size: str = "-Y {} +X {}") -> bytes:
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + size.format(height, width).encode() + b"\n" + rows


def test_radiance_pictures_without_runs_and_with_old_ones(tmp_path: Path) -> None:
    """A pixel (m, e) is m 2^(e - 136), as Ward gives it; narrow rows have no runs of channels."""
    path = tmp_path / "a.hdr"
    path.write_bytes(radiance(bytes((128, 64, 32, 129, 1, 1, 1, 2)), 3, 1))
    np.testing.assert_array_equal(read_image(path), np.tile(np.float32([1.0, 0.5, 0.25]), (1, 3, 1)))
    path.write_bytes(radiance(bytes((128, 0, 0, 129, 0, 128, 0, 129)), 1, 2, "+Y {} +X {}"))
    assert read_image(path).tolist() == [[[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]]]
    path.write_bytes(radiance(bytes((0, 0, 0, 0)), 1, 1))
    assert read_image(path).tolist() == [[[0.0, 0.0, 0.0]]]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.hdr", b""),
        ("a.hdr", radiance(b"", 4, 4)),
        ("a.hdr", radiance(bytes((2, 2, 0, 8, 255, 0)), 8, 1)),
        ("a.hdr", radiance(bytes((1, 1, 1, 255)), 8, 1)),
        ("a.hdr", radiance(b"", 1 << 30, 1 << 30)),
        ("a.hdr", b"#?RADIANCE\n\n-Y a +X 4\n"),
        ("a.pfm", b"PF\n1 1\n"),
        ("a.pfm", b"PF\n4 4\n-1.0\nxx"),
        ("a.pfm", b"PF\n999999 999999\n-1.0\nxx"),
        ("a.pfm", b"P6\n1 1\n-1.0\n" + bytes(12)),
        ("a.tif", b"II*\0\xff\xff\xff\xff"),
        ("a.tif", b"II*\0"),
    ],
)
def test_broken_pictures_are_one_line(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError, match=f"texture .*{name}: cannot be read") as error:
        read_image(tmp_path / name)
    assert "\n" not in str(error.value)
