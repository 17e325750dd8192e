"""Decoders of image files: each returns the values of a file as an array.

OpenImageIO reads values of more than 8 bits, because Pillow supports few of these and truncates 16-bit colours to 8
bits; Pillow reads other files.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenes.radiance import RadianceHeader, header_of

if TYPE_CHECKING:
    from OpenImageIO import BASETYPE, ImageBuf

Pixels = NDArray[np.float32]
_Found = TypeVar("_Found")
_RADIANCE = (".hdr", ".pic", ".rgbe")
_PNG = b"\x89PNG\r\n\x1a\n"
_WIDE = (".exr", ".pfm", ".png", ".tif", ".tiff", *_RADIANCE)

PIXELS_MOST = 1 << 27
"""Maximum number of pixels of an image, such as 16384 x 8192. A file of a few kilobytes can contain more pixels than
fit into memory; one pixel takes about 36 bytes while its scene is loaded."""


def decoded(file: Path | BinaryIO) -> Pixels | NDArray[np.uint8] | NDArray[np.uint16]:
    """The values of an image, or of its content: linear ones are float32, and integers are sRGB-encoded.

    Deviation: Radiance files from before 1991, whose run-length encoding repeats whole pixels, are rejected, as in
    other renderers.

    Values of Radiance files are divided by their exposure and colour correction.

    Returns:
        ``(height, width, 3)`` float32, uint8 or uint16, row 0 at the top.

    Raises:
        ValueError, OSError or other exceptions of the decoders: the file cannot be read.
    """
    if not isinstance(file, Path):
        return _of_content(file, decoded) if _is_png(file) else by_pillow(file)
    header = _header_of(file)
    if header is not None:
        return _radiance(file, header)
    found = _wide(file) if file.suffix.lower() in _WIDE else None
    return by_pillow(file) if found is None else found


def _is_png(content: BinaryIO) -> bool:
    start = content.read(len(_PNG))
    content.seek(0)
    return start == _PNG


def _of_content(content: BinaryIO, read: Callable[[Path], _Found]) -> _Found:
    """What a decoder of files makes of the content of a PNG file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "content.png"
        path.write_bytes(content.read())
        return read(path)


def chromaticities_of(path: Path) -> tuple[float, ...] | None:
    """``x`` and ``y`` of red, green, blue and white of an image of linear values; None if the file does not tell them.

    Raises:
        ValueError or other exceptions of the decoders: the file cannot be read.
    """
    if path.suffix.lower() != ".exr":
        header = _header_of(path)
        return None if header is None else header.chromaticities
    found = _opened(path).spec().getattribute("chromaticities")
    return None if found is None else tuple(map(float, found))


def _header_of(path: Path) -> RadianceHeader | None:
    return header_of(path) if path.suffix.lower() in _RADIANCE else None


def _radiance(path: Path, header: RadianceHeader) -> Pixels:
    """Values of a Radiance file; those of CIE XYZ are not converted."""
    if header.is_plain:
        found = _wide(path)
    else:
        # the library knows neither all orders of rows and columns nor XYZ
        with TemporaryDirectory() as folder:
            plain = Path(folder) / "plain.hdr"
            plain.write_bytes(header.plain + path.read_bytes()[header.start :])
            found = _wide(plain)
    assert found is not None, "values of Radiance files have more than 8 bits"
    return header.upright(found.astype(np.float32))


def _require_size(width: int, height: int) -> None:
    if not (width > 0 and height > 0):
        raise ValueError(f"expected pixels, got {width} x {height}")
    if width * height > PIXELS_MOST:
        raise ValueError(f"expected at most {PIXELS_MOST:,} pixels, got {width} x {height}")


@contextmanager
def _by_pillow(file: Path | BinaryIO) -> Iterator[Image.Image]:
    """An image that Pillow opens; it takes a stream, because it reads turned TIFF files by their path in wrong rows."""
    with file.open("rb") if isinstance(file, Path) else nullcontext(file) as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # large images are rejected here
        with Image.open(stream) as image:
            _require_size(*image.size)
            yield image


def by_pillow(path: Path | BinaryIO) -> Pixels | NDArray[np.uint8] | NDArray[np.uint16]:
    """Like :func:`decoded`, for a file that Pillow reads, or for its content."""
    with _by_pillow(path) as image:
        if image.mode == "F":
            return _three(np.array(image, np.float32)[..., None])
        if image.mode.startswith("I"):  # 16-bit grey
            return _three(np.clip(np.array(image), 0, 65535).astype(np.uint16)[..., None])
        # a palette with several opacities is only converted to colours by way of RGBA without a warning
        through = "RGBA" if image.mode == "P" and "transparency" in image.info else image.mode
        return np.array(image.convert(through).convert("RGB"))


def alpha_of(file: Path | BinaryIO) -> Pixels:
    """The opacity ``(h, w)`` of an image, or of its content, 0 to 1; 1 if it has none.

    Raises:
        ValueError, OSError or other exceptions of the decoders: the file cannot be read.
    """
    if not isinstance(file, Path):
        return _of_content(file, alpha_of) if _is_png(file) else _alpha_by_pillow(file)
    if file.suffix.lower() in _RADIANCE:
        return np.ones(decoded(file).shape[:2], np.float32)
    found = _wide_alpha(file) if file.suffix.lower() in _WIDE else None
    return _alpha_by_pillow(file) if found is None else found


def _alpha_by_pillow(file: Path | BinaryIO) -> Pixels:
    with _by_pillow(file) as image:
        if "A" not in image.getbands() and "transparency" not in image.info:
            return np.ones((image.height, image.width), np.float32)
        return np.array(image.convert("RGBA"))[..., 3].astype(np.float32) / np.float32(255.0)


def _three(pixels: np.ndarray) -> np.ndarray:
    """Colours of pixels ``(h, w, channels)``; with fewer than three channels the first is grey."""
    return pixels[..., :3] if pixels.shape[-1] >= 3 else np.repeat(pixels[..., :1], 3, axis=-1)


def _opened(path: Path) -> ImageBuf:
    """An image whose values are read on demand; of several parts of a file the first one that has colours.

    Raises:
        ValueError: the file cannot be read.
    """
    import OpenImageIO as oiio  # imported here: its types complain if a process ends before it used any

    oiio.attribute("threads", 1)  # threads would not survive a fork
    oiio.attribute("exr_threads", -1)
    hints = oiio.ImageSpec()
    hints.attribute("oiio:UnassociatedAlpha", 1)  # colours are not multiplied by alpha
    first = oiio.ImageBuf(str(path), 0, 0, hints)
    _require_read(first)
    others = range(1, first.nsubimages) if _is_exr(first) and not _has_colours(first) else ()
    parts = (oiio.ImageBuf(str(path), part, 0, hints) for part in others)
    return next((part for part in parts if _has_colours(part)), first)


def _is_exr(image: ImageBuf) -> bool:
    return image.file_format_name == "openexr"


def _has_colours(image: ImageBuf) -> bool:
    return red_green_blue(image.spec().channelnames) is not None


def red_green_blue(names: Sequence[str]) -> tuple[int, int, int] | None:
    """Indices of red, green and blue by the names of channels: those without a layer, or those of the first layer,
    such as ``ViewLayer.Combined.R``, that has all three; None if there are none."""
    places = {name.lower(): place for place, name in enumerate(names)}
    layers = dict.fromkeys(("", *(name.lower().rpartition(".")[0] for name in names)))
    for layer in layers:
        for colours in (("r", "g", "b"), ("red", "green", "blue")):
            full = [f"{layer}.{one}".lstrip(".") for one in colours]
            if all(one in places for one in full):
                return places[full[0]], places[full[1]], places[full[2]]
    return None


def _colours_of(image: ImageBuf) -> tuple[int, ...]:
    """Indices of the channels of an image that are its colours, one if it is grey.

    Raises:
        ValueError: the channels are neither colours nor grey.
    """
    spec = image.spec()
    found = red_green_blue(spec.channelnames)
    if found is not None:
        return found
    layer = spec.channelnames[0].rpartition(".")[0]
    channels = [place for place, name in enumerate(spec.channelnames) if name.rpartition(".")[0] == layer]
    chroma = _is_exr(image) and any(name.rpartition(".")[2] in ("RY", "BY") for name in spec.channelnames)
    if chroma or (len(channels) == 2 and spec.alpha_channel not in channels):
        raise ValueError(f"expected red, green and blue, or grey, got {' and '.join(spec.channelnames)}")
    return tuple(channels[:3]) if len(channels) >= 3 else (channels[0],)


def _size_of(image: ImageBuf) -> tuple[int, int]:
    """Width and height of a picture: those of the display window in an OpenEXR file."""
    spec = image.spec()
    return (spec.full_width, spec.full_height) if _is_exr(image) else (spec.width, spec.height)


def _values(image: ImageBuf, kind: BASETYPE) -> np.ndarray:
    """All channels ``(h, w, channels)`` that were read, upright; 0 where the data of an OpenEXR file do not cover its
    display window. The orientation of a TIFF file is part of its format, that of metadata is ignored as in JPEG."""
    import OpenImageIO as oiio

    if _is_exr(image):
        pixels = image.get_pixels(kind, image.spec().roi_full)
    else:
        upright = oiio.ImageBufAlgo.reorient(image) if image.file_format_name == "tiff" else image
        pixels = upright.get_pixels(kind)
    _require_read(image)
    assert pixels is not None
    return pixels


def _wide(path: Path) -> Pixels | NDArray[np.uint16] | None:
    """Values of more than 8 bits; None for 8-bit files."""
    import OpenImageIO as oiio

    image = _opened(path)
    spec = image.spec()
    if spec.format.basetype in (oiio.UINT8, oiio.INT8):
        return None
    _require_size(*_size_of(image))
    colours = _colours_of(image)
    whole = spec.channelformat(colours[0]).basetype == oiio.UINT and _is_exr(image)  # numbers, not fractions
    linear = spec.format.basetype in (oiio.HALF, oiio.FLOAT, oiio.DOUBLE) or whole
    first = min(colours)
    image.read(image.subimage, 0, first, max(colours) + 1, True, oiio.UINT if whole else oiio.TypeUnknown)
    _require_read(image)
    pixels = _values(image, oiio.UINT if whole else oiio.FLOAT if linear else oiio.UINT16)
    pixels = pixels[..., [one - first for one in colours]]
    if not linear and spec.getattribute("tiff:PhotometricInterpretation") == 0:  # white is zero
        pixels = np.uint16(65535) - pixels
    return _three(pixels.astype(np.float32) if whole else pixels)


def _wide_alpha(path: Path) -> Pixels | None:
    """The opacity of an image of more than 8 bits; None for 8-bit files."""
    import OpenImageIO as oiio

    image = _opened(path)
    spec = image.spec()
    if spec.format.basetype in (oiio.UINT8, oiio.INT8):
        return None
    _require_size(*_size_of(image))
    pixels = _values(image, oiio.FLOAT)  # integers as fractions
    if spec.alpha_channel < 0:
        return np.ones(pixels.shape[:2], np.float32)
    alpha = pixels[..., spec.alpha_channel]
    if not np.isfinite(alpha).all():
        raise ValueError("expected finite opacities")
    return np.clip(alpha, 0.0, 1.0)


def _require_read(image: ImageBuf) -> None:
    if image.has_error:
        raise ValueError(image.geterror().partition("\n")[0])


def resized(image: Pixels, height: int, width: int) -> Pixels:
    """An image ``(h, w, c)`` with another number of rows and columns, by nearest-neighbour sampling."""
    rows = np.arange(height) * image.shape[0] // height
    columns = np.arange(width) * image.shape[1] // width
    return image[rows[:, None], columns[None]]
