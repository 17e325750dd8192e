"""Pictures of every kind are read correctly."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from scenes import pictures
from scenes.canonical import SceneError
from scenes.loading import is_linear, read_alpha, read_image
from scenes.pictures import alpha_of
from tests.scenes.formats.files import CASES

FOLDER = CASES / "picture-files"
OWN = Path(__file__).parent / "cases"


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


def test_radiance_pictures_without_runs(tmp_path: Path) -> None:
    """A pixel (m, e) is m 2^(e - 136), as Ward gives it; narrow rows have no runs of channels."""
    path = tmp_path / "a.hdr"
    path.write_bytes(radiance(bytes((128, 64, 32, 129)) * 3, 3, 1))
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
        ("a.hdr", radiance(bytes((128, 64, 32, 129, 1, 1, 1, 2)), 3, 1)),  # runs of whole pixels
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


def test_a_ramp_of_16_bits_is_a_ramp() -> None:
    ramp = read_image(OWN / "grey-ramp-16.png")[0, :, 0]
    assert (np.diff(ramp) > 0.0).all() and ramp[0] == 0.0 and ramp[-1] == 1.0
    assert ramp[len(ramp) // 2] == pytest.approx(0.21, abs=0.02)


def test_a_sun_that_overflows_is_clamped_with_a_word() -> None:
    with pytest.warns(UserWarning, match=r"infinite-sun\.exr: \d+ pixels of infinite radiance became 65504"):
        found = read_image(OWN / "infinite-sun.exr")
    assert np.isfinite(found).all() and found.max() == 65504.0


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "PA", "RGBA", "CMYK"])
def test_grey_palettes_and_alpha_are_the_colours_they_mean(mode: str, tmp_path: Path) -> None:
    """Alpha is no colour: what it hides keeps its own."""
    picture = Image.new("RGB", (4, 2), (255, 255, 255))
    picture.paste((0, 0, 0), (0, 0, 2, 2))
    if mode == "PA":
        picture = picture.convert("P")
        picture.info["transparency"] = 0
    elif mode in ("LA", "RGBA"):
        picture = picture.convert(mode)
        picture.putalpha(77)
    else:
        picture = picture.convert(mode)
    path = tmp_path / ("a.tif" if mode == "CMYK" else "a.png")
    picture.save(path)
    found = read_image(path)
    assert found[:, :2] == pytest.approx(np.zeros((2, 2, 3)), abs=1e-6)
    assert found[:, 2:] == pytest.approx(np.ones((2, 2, 3)), abs=1e-6)


def test_portable_float_maps_are_scaled(tmp_path: Path) -> None:
    (tmp_path / "a.pfm").write_bytes(b"PF\n1 1\n-2.0\n" + np.float32([1.0, 0.5, 0.25]).tobytes())
    assert read_image(tmp_path / "a.pfm").tolist() == [[[2.0, 1.0, 0.5]]]


@pytest.mark.parametrize("channels", [2, 4, 6])
def test_16_bits_with_colour_or_alpha(channels: int, tmp_path: Path) -> None:
    """PNG of colour type 4 (grey and alpha), 2 (colours) and 6 (both)."""
    kinds = {2: (4, 2), 4: (6, 4), 6: (2, 3)}
    kind, count = kinds[channels]
    values = np.full((2, 3, count), 65535, ">u2")
    values[..., : count - (kind in (4, 6))] = 32700
    rows = b"".join(b"\0" + row.tobytes() for row in values)

    def chunk(name: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    header = struct.pack(">IIBBBBB", 3, 2, 16, kind, 0, 0, 0)
    path = tmp_path / "a.png"
    parts = (chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(rows)), chunk(b"IEND", b""))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))
    # 8 bits would give that of 127 / 255
    assert read_image(path) == pytest.approx(np.full((2, 3, 3), decoded(32700 / 65535)), rel=1e-5)


def png_of_16_bits(values: np.ndarray, color_type: int, transparent: bytes, name: bytes = b"tRNS") -> bytes:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", values.shape[1], values.shape[0], 16, color_type, 0, 0, 0)
    rows = zlib.compress(b"".join(b"\0" + row.astype(">u2").tobytes() for row in values))
    parts = (b"IHDR", header), (name, transparent), (b"IDAT", rows), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts)


@pytest.mark.parametrize("grey", [False, True])
def test_the_transparent_colour_of_16_bits_is_compared_in_all_bits(grey: bool, tmp_path: Path) -> None:
    """A colour that differs in the last bit is opaque; the file and its content, as glTF embeds it, are the same."""
    values = np.array([[300, 301], [65535, 0]] if grey else [[[300, 2, 3], [301, 2, 3]], [[65535, 0, 0], [0, 0, 0]]])
    content = png_of_16_bits(values, 0 if grey else 2, struct.pack(">H" if grey else ">HHH", *np.ravel(values[0, 0])))
    path = tmp_path / "a.png"
    path.write_bytes(content)
    assert read_alpha(path).tolist() == alpha_of(io.BytesIO(content)).tolist() == [[0.0, 1.0], [1.0, 1.0]]
    expected = np.repeat(values[..., None], 3, axis=-1) if grey else values
    assert np.array_equal(pictures.decoded(path), expected)
    assert np.array_equal(pictures.decoded(io.BytesIO(content)), expected)


def test_alpha_of_openexr_and_radiance(tmp_path: Path) -> None:
    given = np.array([[0.0, 0.25], [1.0, 7.0]], np.float32)
    channels = {"R": given, "G": given, "B": given, "A": given}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(tmp_path / "a.exr"))
    assert read_alpha(tmp_path / "a.exr").tolist() == [[0.0, 0.25], [1.0, 1.0]]
    OpenEXR.File(header, {"Y": given}).write(str(tmp_path / "none.exr"))
    assert read_alpha(tmp_path / "none.exr").tolist() == [[1.0, 1.0], [1.0, 1.0]]
    OpenEXR.File(header, channels | {"A": given * np.float32("nan")}).write(str(tmp_path / "broken.exr"))
    with pytest.raises(SceneError, match="broken.exr: cannot be read: expected finite opacities"):
        read_alpha(tmp_path / "broken.exr")
    (tmp_path / "a.hdr").write_bytes(radiance(bytes([128, 64, 32, 129] * 2), 2, 1))
    assert read_alpha(tmp_path / "a.hdr").tolist() == [[1.0, 1.0]]


@pytest.mark.parametrize("bits", [8, 16])
def test_how_a_camera_was_held_does_not_turn_a_png(bits: int, tmp_path: Path) -> None:
    """Texture coordinates mean the pixels as they are stored, as in JPEG."""
    held = b"MM\0*\0\0\0\x08" + struct.pack(">HHHIHHI", 1, 0x112, 3, 1, 6, 0, 0)
    values = np.arange(18).reshape(2, 3, 3)
    content = png_of_16_bits(values, 2, held, b"eXIf")
    if bits == 8:
        exif = Image.Exif()
        exif.load(b"Exif\0\0" + held)
        stream = io.BytesIO()
        Image.fromarray(values.astype(np.uint8)).save(stream, "png", exif=exif)
        content = stream.getvalue()
    (tmp_path / "a.png").write_bytes(content)
    np.testing.assert_array_equal(pictures.decoded(tmp_path / "a.png"), values)
