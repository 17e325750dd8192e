"""Image files keep their values, appear complete or not at all, and refuse values that they cannot hold."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from renderer.film.files import (
    FilmError,
    Mp4Writer,
    encode_srgb,
    read_exr,
    write_exr,
    write_image,
    write_png,
    write_ppm,
)
from renderer.film.sequence import write_lossless

STILL = [write_exr, write_png, write_ppm]
ENDING = {write_exr: ".exr", write_png: ".png", write_ppm: ".ppm"}

# two rows of three pixels, every channel another, nothing symmetric
VALUES = torch.tensor([[[0.0, 0.5, 1.0], [0.002, 0.03, 0.8], [0.1, 0.2, 0.3]],
                       [[0.9, 0.6, 0.01], [-1.0, 7.0, 0.25], [0.7, 0.0, 0.04]]])  # fmt: skip


def srgb(value: float) -> float:
    """IEC 61966-2-1, in [0, 255]."""
    value = min(max(value, 0.0), 1.0)
    return 255.0 * (12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055)


EXPECTED = np.vectorize(lambda v: round(srgb(v)))(VALUES.numpy().astype(float)).astype(np.uint8)


def test_exr_float_keeps_every_bit(tmp_path: Path) -> None:
    image = torch.randn(5, 7, 3) * 1e6
    image[0, 0] = torch.tensor([math.inf, math.nan, -0.0])
    assert write_exr(tmp_path / "deep" / "a.exr", image, half=False) == 2
    found = read_exr(tmp_path / "deep" / "a.exr")
    assert found.dtype == np.float32 and np.array_equal(found.view(np.int32), image.numpy().view(np.int32))


def test_exr_half_rounds_and_never_overflows(tmp_path: Path) -> None:
    """Values beyond the range become its greatest; infinite values stay infinite and are counted."""
    image = torch.randn(5, 7, 3)
    image[0, 0] = torch.tensor([1e9, -1e9, 65505.0])
    image[0, 1] = torch.tensor([math.inf, -math.inf, math.nan])
    assert write_exr(tmp_path / "a.exr", image) == 3
    found = read_exr(tmp_path / "a.exr")
    assert found[0, 0].tolist() == [65504.0, -65504.0, 65504.0]
    assert found[0, 1, :2].tolist() == [math.inf, -math.inf] and math.isnan(found[0, 1, 2])
    assert np.array_equal(found[1:], image[1:].numpy().astype(np.float16).astype(np.float32))


def test_png_holds_srgb_values_in_place(tmp_path: Path) -> None:
    assert write_png(tmp_path / "a.png", VALUES) == 0
    found = np.asarray(Image.open(tmp_path / "a.png"))
    assert found.shape == (2, 3, 3) and np.array_equal(found, EXPECTED)


def test_ppm_is_a_header_and_bytes(tmp_path: Path) -> None:
    assert write_ppm(tmp_path / "a.ppm", VALUES) == 0
    assert (tmp_path / "a.ppm").read_bytes() == b"P6\n3 2\n255\n" + EXPECTED.tobytes()


@given(st.floats(-1.0, 3.0, width=32))
def test_encoding_is_the_nearest_srgb_code(value: float) -> None:
    code = int(encode_srgb(torch.full((1, 1, 3), value))[0, 0, 1])
    assert abs(code - srgb(value)) <= 0.5 + 1e-3


def test_a_lossless_film_keeps_every_value_and_repeats(tmp_path: Path) -> None:
    frames = np.random.default_rng(3).integers(0, 256, (4, 11, 17, 3), dtype=np.uint8)
    for name in ("a.mkv", "b.mkv"):
        write_lossless(iter(frames), tmp_path / name, 29.97)
    with av.open(str(tmp_path / "a.mkv")) as film:
        found = np.stack([frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)])
        assert float(film.streams.video[0].average_rate or 0.0) == pytest.approx(29.97, abs=0.01)
    np.testing.assert_array_equal(found, frames)
    assert (tmp_path / "a.mkv").read_bytes() == (tmp_path / "b.mkv").read_bytes()


@pytest.mark.parametrize("write", STILL)
def test_nonfinite_values_are_counted(write: Callable, tmp_path: Path) -> None:
    image = VALUES.clone()
    image[1, 2] = torch.tensor([math.nan, math.inf, -math.inf])
    place = tmp_path / f"a{ENDING[write]}"
    assert write(place, image) == 3
    if write is not write_exr:
        assert np.asarray(Image.open(place))[1, 2].tolist() == [0, 255, 0]


def test_the_ending_chooses_the_format(tmp_path: Path) -> None:
    for ending, magic in ((".exr", b"\x76\x2f\x31\x01"), (".PNG", b"\x89PNG"), (".ppm", b"P6")):
        write_image(tmp_path / f"a{ending}", VALUES)
        assert (tmp_path / f"a{ending}").read_bytes().startswith(magic)
    with pytest.raises(FilmError, match=r"a\.jpg: expected a name ending in \.exr, \.png, \.ppm, got '\.jpg'"):
        write_image(tmp_path / "a.jpg", VALUES)
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("write", STILL)
def test_places_that_cannot_be_written_are_named(write: Callable, tmp_path: Path) -> None:
    """A file in place of the folder, and a folder in place of the file."""
    (tmp_path / "file").touch()
    (tmp_path / f"folder{ENDING[write]}").mkdir()
    before = sorted(tmp_path.iterdir())
    for place in (f"file/a{ENDING[write]}", f"file/b/a{ENDING[write]}", f"folder{ENDING[write]}"):
        with pytest.raises(FilmError, match=rf"{place}: cannot be written \(.+\)"):
            write(tmp_path / place, VALUES)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("content", [b"", b"not an image", None])
def test_what_is_no_exr_is_refused(content: bytes | None, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / "a.exr").write_bytes(content)
    with pytest.raises(FilmError, match=r"a\.exr: cannot be read"):
        read_exr(tmp_path / "a.exr")


@pytest.mark.parametrize(("width", "height"), [(15, 16), (16, 15), (0, 16), (16, 0), (-2, 16)])
def test_odd_film_sizes_are_refused(width: int, height: int, tmp_path: Path) -> None:
    with pytest.raises(FilmError, match=rf"even width and height, got {width} x {height}"):
        Mp4Writer(tmp_path / "a.mp4", 30, width, height)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fps", [0.0, -1.0, math.nan])
def test_bad_frame_rates_are_refused(fps: float, tmp_path: Path) -> None:
    with pytest.raises(FilmError, match="positive frame rate"):
        Mp4Writer(tmp_path / "a.mp4", fps, 16, 16)


def test_a_film_that_cannot_be_begun_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(FilmError, match=r"file/a\.mp4: cannot be written"), Mp4Writer(tmp_path / "file/a.mp4", 9, 8, 8):
        pass


def test_a_frame_of_another_size_is_refused_and_nothing_stays(tmp_path: Path) -> None:
    with pytest.raises(FilmError, match=r"expected frames 16 x 32 x 3, got \(32, 16, 3\)"):
        with Mp4Writer(tmp_path / "a.mp4", 30, 32, 16) as writer:
            writer.add(np.zeros((16, 32, 3), np.uint8))
            writer.add(np.zeros((32, 16, 3), np.uint8))
    assert list(tmp_path.iterdir()) == []


def test_a_film_that_cannot_be_ended_leaves_nothing(tmp_path: Path) -> None:
    """The disk fills up when the last frames are written."""

    class Full:
        def __init__(self, container) -> None:
            self.mux, self._close = container.mux, container.close

        def close(self) -> None:
            self._close()
            raise OSError(28, "No space left on device")

    for error, expected in ((None, FilmError), (KeyboardInterrupt, KeyboardInterrupt)):
        with pytest.raises(expected, match="No space left" if error is None else None):
            with Mp4Writer(tmp_path / "a.mp4", 30, 16, 16) as writer:
                writer._container = Full(writer._container)
                writer.add(np.zeros((16, 16, 3), np.uint8))
                if error is not None:
                    raise error
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("side", "color"), [(64, (0, 255, 0)), (64, (255, 0, 0)), (720, (30, 60, 200))])
def test_a_film_says_what_its_colours_mean(side: int, color: tuple[int, int, int], tmp_path: Path) -> None:
    """Tags, and luma and chroma by the formula of ITU-R BT.709 in the limited range."""
    with Mp4Writer(tmp_path / "a.mp4", 30, side, side) as writer:
        writer.add(np.full((side, side, 3), color, np.uint8))
    with av.open(str(tmp_path / "a.mp4")) as film:
        context = film.streams.video[0].codec_context
        assert (context.colorspace, context.color_primaries, context.color_trc) == (1, 1, 13)  # bt709, bt709, sRGB
        assert context.color_range == 1  # limited
        frame = next(film.decode(video=0))
    red, green, blue = (value / 255.0 for value in color)
    luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    planes = frame.to_ndarray().reshape(-1)
    of_blue, of_red = (128.0 + 224.0 * part for part in ((blue - luma) / 1.8556, (red - luma) / 1.5748))
    assert planes[0] == pytest.approx(16.0 + 219.0 * luma, abs=2.0)
    assert planes[side * side] == pytest.approx(of_blue, abs=2.0)
    assert planes[-1] == pytest.approx(of_red, abs=2.0)
    assert frame.to_ndarray(format="rgb24")[5, 5] == pytest.approx(color, abs=4)


@pytest.mark.parametrize("fps", [24.0, 60.0, 30000 / 1001, 7.5])
def test_film_rate_and_order(fps: float, tmp_path: Path) -> None:
    with Mp4Writer(tmp_path / "a.mp4", fps, 32, 16) as writer:
        for number in range(5):
            writer.add(np.full((16, 32, 3), 40 * number + 20, np.uint8))
    with av.open(str(tmp_path / "a.mp4")) as container:
        assert float(container.streams.video[0].average_rate) == pytest.approx(fps)
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert [frame.shape for frame in frames] == [(16, 32, 3)] * 5
    assert all(abs(int(frame[8, 16, 1]) - 40 * i - 20) <= 6 for i, frame in enumerate(frames))
