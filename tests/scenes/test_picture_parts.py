"""Which part of a picture file is its picture: channels, layers, parts and windows of OpenEXR, and what tags mean."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from scenes.canonical import SceneError
from scenes.loading import is_linear, read_alpha, read_image
from scenes.pictures import decoded

RAMP = np.arange(1, 7, dtype=np.float32).reshape(2, 3)
COLOURS = np.stack([RAMP, 10.0 * RAMP, 100.0 * RAMP], axis=-1)
LINES = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}


def layer(name: str, letters: str = "RGB") -> dict[str, np.ndarray]:
    return {f"{name}{letter}": np.float32(10.0**place) * RAMP for place, letter in enumerate(letters)}


@pytest.mark.parametrize(
    "channels",
    [
        {"Depth.Z": RAMP * 7.0, **layer("ViewLayer.Combined.")},
        {"Albedo.R": RAMP, "Albedo.G": RAMP, "Albedo.B": RAMP, **layer("")},
        {"AO": RAMP * 7.0, "Index.X": RAMP, **layer("beauty.", "rgb")},
        {"a.V": RAMP, **{f"c.{name}": np.float32(10.0**at) * RAMP for at, name in enumerate(("red", "green", "blue"))}},
        {**layer(""), "id": RAMP.astype(np.uint32)},
    ],
)
def test_colours_are_found_by_their_names(channels: dict[str, np.ndarray], tmp_path: Path) -> None:
    """Channels of a file are in the order of the alphabet, whatever they are."""
    OpenEXR.File(LINES, channels).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), COLOURS)


def test_without_colours_the_first_layer_is_grey(tmp_path: Path) -> None:
    channels = {"depth.Z": RAMP, "normal.X": -RAMP, "normal.Y": -RAMP, "normal.Z": -RAMP}
    OpenEXR.File(LINES, channels).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), np.repeat(RAMP[..., None], 3, axis=-1))


def test_the_part_with_colours_is_the_picture(tmp_path: Path) -> None:
    made = {"depth": {"Z": RAMP}, "beauty": layer("")}
    parts = [OpenEXR.Part(LINES | {"name": name}, channels, name) for name, channels in made.items()]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), COLOURS)


def test_brightness_with_chroma_is_refused(tmp_path: Path) -> None:
    OpenEXR.File(LINES, {"Y": RAMP, "RY": RAMP, "BY": RAMP}).write(str(tmp_path / "a.exr"))
    with pytest.raises(SceneError, match="expected red, green and blue, or grey, got Y and BY and RY"):
        read_image(tmp_path / "a.exr")


def test_whole_numbers_of_openexr_are_numbers(tmp_path: Path) -> None:
    whole = {name: values.astype(np.uint32) for name, values in layer("").items()}
    OpenEXR.File(LINES, whole).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), COLOURS)
    assert is_linear(tmp_path / "a.exr")


@pytest.mark.parametrize(("left", "top"), [(1, 1), (-1, 0), (5, 3), (-2, -1)])
def test_a_picture_fills_its_display_window(left: int, top: int, tmp_path: Path) -> None:
    """Data outside are not shown; where there are none it is black and clear."""
    corner = np.array([left, top], np.int32)
    windows = {
        "dataWindow": (corner, corner + np.array([2, 1], np.int32)),
        "displayWindow": (np.zeros(2, np.int32), np.array([5, 3], np.int32)),
    }
    OpenEXR.File(LINES | windows, {**layer(""), "A": np.ones_like(RAMP)}).write(str(tmp_path / "a.exr"))
    expected, alpha = np.zeros((4, 6, 3), np.float32), np.zeros((4, 6), np.float32)
    for row in range(2):
        for column in range(3):
            if 0 <= top + row < 4 and 0 <= left + column < 6:
                expected[top + row, left + column] = COLOURS[row, column]
                alpha[top + row, left + column] = 1.0
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), expected)
    np.testing.assert_array_equal(read_alpha(tmp_path / "a.exr"), alpha)


def test_pixels_that_are_not_numbers_are_counted(tmp_path: Path) -> None:
    holed = RAMP.copy()
    holed[0, 1] = np.nan
    OpenEXR.File(LINES, {"R": holed, "G": RAMP, "B": RAMP}).write(str(tmp_path / "a.exr"))
    with pytest.raises(SceneError, match=r"a\.exr: expected finite values, got 1 pixels without"):
        read_image(tmp_path / "a.exr")


def test_radiance_pictures_need_no_format(tmp_path: Path) -> None:
    """Radiance takes a header without FORMAT for red, green and blue."""
    header = b"#?RADIANCE\nEXPOSURE=2\nEXPOSURE=2\n\n-Y 1 +X 1\n"
    (tmp_path / "a.hdr").write_bytes(header + bytes((128, 64, 32, 129)))
    assert read_image(tmp_path / "a.hdr").tolist() == [[[0.25, 0.125, 0.0625]]]


def tiff(values: np.ndarray, white_is_zero: bool, orientation: int = 1) -> bytes:
    """A grey picture in one strip, written by hand after TIFF 6.0."""
    height, width = values.shape
    entries = [(256, width), (257, height), (258, 8 * values.itemsize), (259, 1), (262, 0 if white_is_zero else 1),
               (273, 0), (274, orientation), (277, 1), (278, height), (279, values.nbytes)]  # fmt: skip
    start = 8 + 2 + 12 * len(entries) + 4
    made = b"II*\0" + struct.pack("<IH", 8, len(entries))
    for tag, value in entries:
        made += struct.pack("<HHIHH", tag, 3, 1, start if tag == 273 else value, 0)
    return made + struct.pack("<I", 0) + values.tobytes()


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32])
def test_white_may_be_zero_in_tiff(kind: type, tmp_path: Path) -> None:
    values = np.array([[0, np.iinfo(kind).max]], kind)
    (tmp_path / "a.tif").write_bytes(tiff(values, True))
    assert read_image(tmp_path / "a.tif")[0, :, 1].tolist() == [1.0, 0.0]
    (tmp_path / "b.tif").write_bytes(tiff(values, False))
    assert read_image(tmp_path / "b.tif")[0, :, 1].tolist() == [0.0, 1.0]


def test_opacity_lies_as_the_colours_of_a_turned_tiff(tmp_path: Path) -> None:
    (tmp_path / "a.tif").write_bytes(tiff(np.zeros((2, 3), np.uint16), False, 6))
    assert read_image(tmp_path / "a.tif").shape == (3, 2, 3) and read_alpha(tmp_path / "a.tif").shape == (3, 2)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_grey_tiff_without_compression_is_turned(kind: type, orientation: int, tmp_path: Path) -> None:
    values = (np.arange(6).reshape(2, 3) * (np.iinfo(kind).max // 5)).astype(kind)
    flipped = (values, values[:, ::-1], values[::-1, ::-1], values[::-1])[(orientation - 1) % 4]
    turns = {5: values, 6: values[::-1], 7: values[::-1, ::-1], 8: values[:, ::-1]}
    (tmp_path / "a.tif").write_bytes(tiff(values, False, orientation))
    expected = turns[orientation].T if orientation > 4 else flipped
    assert np.array_equal(decoded(tmp_path / "a.tif")[..., 1], expected)
    assert read_alpha(tmp_path / "a.tif").shape == expected.shape
