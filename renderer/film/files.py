"""Image files: EXR (linear, half or float), PNG and PPM (sRGB, 8 bit), and MP4 sequences.

Every writer writes to a temporary file, moves it into place, and returns the number of non-finite values.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from scenes.arithmetic import power

STILL_FORMATS = (".exr", ".png", ".ppm")


class FilmError(ValueError):
    """An image that cannot be written; the message names the file and the reason."""


@contextmanager
def placed(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path``. The file is moved to ``path`` when the block succeeds, and removed when it
    fails."""
    temporary = path.with_name(f"{path.stem}.partial{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if not os.access(path.parent, os.W_OK):
            raise FilmError(f"{path}: the folder is not writable")
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise FilmError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        try:
            temporary.unlink(missing_ok=True)
        except OSError:
            pass


def count_nonfinite(image: Tensor) -> int:
    """Number of infinite and NaN values."""
    return int((~torch.isfinite(image)).sum())


def encode_srgb(image: Float[Tensor, "h w 3"]) -> NDArray[np.uint8]:
    """``(h, w, 3)`` uint8 sRGB of linear radiance, clipped; NaN becomes black, infinity white."""
    finite = torch.nan_to_num(image.detach().cpu().to(torch.float32), nan=0.0, posinf=1.0, neginf=0.0)
    return np.searchsorted(_steps(), finite.numpy(), side="right").astype(np.uint8)


@lru_cache(maxsize=1)
def _steps() -> NDArray[np.float32]:
    """Least radiance of each of the codes 1 to 255; comparison with them gives the same codes on every processor."""
    middle = (np.arange(255) + 0.5) / 255.0
    return np.where(middle > 0.04045, power((middle + 0.055) / 1.055, 2.4), middle / 12.92).astype(np.float32)


def write_exr(path: Path, image: Float[Tensor, "h w 3"], half: bool = True) -> int:
    """Writes linear radiance.

    Args:
        path: file to write.
        image: linear RGB.
        half: 16-bit floats; False keeps 32 bits.

    Returns:
        Number of non-finite values (they are written unchanged).

    Raises:
        FilmError: the file cannot be written.
    """
    import OpenEXR

    pixels = np.ascontiguousarray(image.detach().cpu().numpy(), dtype=np.float32)
    if half:
        limit = np.float32(np.finfo(np.float16).max)
        # values beyond the range of half would silently become infinite
        pixels = np.where(np.isfinite(pixels), np.clip(pixels, -limit, limit), pixels).astype(np.float16)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with placed(path) as temporary:
        try:
            OpenEXR.File(header, {"RGB": pixels}).write(str(temporary))
        except (RuntimeError, ValueError) as error:
            raise FilmError(f"{path}: cannot be written ({error})") from None
    return count_nonfinite(image)


def read_exr(path: Path) -> NDArray[np.float32]:
    """``(h, w, 3)`` float32 linear RGB of an EXR file with RGB channels."""
    import OpenEXR

    try:
        with OpenEXR.File(str(path)) as file:
            return np.asarray(file.channels()["RGB"].pixels, dtype=np.float32)
    except (RuntimeError, KeyError, OSError, ValueError) as error:
        raise FilmError(f"{path}: cannot be read as RGB EXR ({error})") from None


def write_png(path: Path, image: Float[Tensor, "h w 3"]) -> int:
    """Writes an 8-bit sRGB PNG; returns and raises as :func:`write_exr`."""
    from PIL import Image

    with placed(path) as temporary:
        Image.fromarray(encode_srgb(image)).save(temporary, format="PNG")
    return count_nonfinite(image)


def write_ppm(path: Path, image: Float[Tensor, "h w 3"]) -> int:
    """Writes an 8-bit sRGB binary PPM (P6); returns and raises as :func:`write_exr`."""
    pixels = encode_srgb(image)
    with placed(path) as temporary:
        temporary.write_bytes(f"P6\n{pixels.shape[1]} {pixels.shape[0]}\n255\n".encode() + pixels.tobytes())
    return count_nonfinite(image)


def write_image(path: str | Path, image: Float[Tensor, "h w 3"] | NDArray[np.floating]) -> int:
    """Writes the format given by the ending of the name; returns and raises as :func:`write_exr`.

    Args:
        path: ending in .exr, .png or .ppm.
        image: linear RGB, a tensor or an array.
    """
    path, image = Path(path), torch.as_tensor(image)
    writers = {".exr": write_exr, ".png": write_png, ".ppm": write_ppm}
    ending = path.suffix.lower()
    if ending not in writers:
        raise FilmError(f"{path}: expected a name ending in {', '.join(STILL_FORMATS)}, got {ending!r}")
    return writers[ending](path, image)


class _FilmWriter:
    """Writer of a film, frame by frame.

    A context manager: the file appears under its name when the block succeeds. Frames have 8 bits.

    Attributes:
        frames: number of frames written.
    """

    def __init__(self, path: Path, fps: float, width_px: int, height_px: int) -> None:
        """Raises FilmError if the rate is not positive or the file cannot be written."""
        if not fps > 0:
            raise FilmError(f"{path}: expected a positive frame rate, got {fps}")
        self.path, self.frames = path, 0
        self._size, self._fps = (width_px, height_px), fps
        self._placing = placed(path)

    def _add_stream(self, container: Any) -> Any:
        """A configured video stream in the container."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        import av
        from av.error import FFmpegError

        temporary = self._placing.__enter__()
        try:
            self._container = av.open(str(temporary), mode="w", options={"fflags": "+bitexact"})
            self._stream = self._add_stream(self._container)
            self._stream.width, self._stream.height = self._size
        except (FFmpegError, OSError) as error:
            self._placing.__exit__(FilmError, FilmError(), None)
            raise FilmError(f"{self.path}: cannot be written ({error})") from None
        return self

    def add(self, pixels: NDArray[np.uint8]) -> None:
        """Appends a frame ``(h, w, 3)`` uint8 sRGB."""
        import av

        if pixels.shape != (self._size[1], self._size[0], 3):
            raise FilmError(f"{self.path}: expected frames {self._size[1]} x {self._size[0]} x 3, got {pixels.shape}")
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), format="rgb24")
        for packet in self._stream.encode(self._converted(frame)):
            self._container.mux(packet)
        self.frames += 1

    def _converted(self, frame: Any) -> Any:
        """A frame converted to the colour space of the stream."""
        return frame

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> bool | None:
        failure = self._finish(complete=kind is None)
        if kind is None and failure is not None:
            self._placing.__exit__(FilmError, failure, None)
            raise failure
        return self._placing.__exit__(kind, error, trace)  # type: ignore[arg-type]

    def _finish(self, complete: bool) -> FilmError | None:
        """Flushes the encoder and closes the file; returns the error, if there was one."""
        from av.error import FFmpegError

        try:
            try:
                for packet in self._stream.encode() if complete else ():
                    self._container.mux(packet)
            finally:
                self._container.close()
        except (FFmpegError, OSError) as error:
            return FilmError(f"{self.path}: cannot be written ({error})")
        return None


class Mp4Writer(_FilmWriter):
    """Writer of an H.264 film (MPEG-4 part 2 where there is no H.264 encoder) of even width and height.

    Luma and chroma are those of ITU-R BT.709 in the limited range; the transfer function is that of sRGB (IEC
    61966-2-1), in which frames are encoded. The stream is tagged accordingly: without tags a player would guess the
    matrix from the size.
    """

    def __init__(self, path: Path, fps: float, width_px: int, height_px: int, crf: int = 18) -> None:
        """Raises FilmError if a size is odd, the rate is not positive, or the file cannot be written."""
        if width_px % 2 or height_px % 2 or min(width_px, height_px) < 2:
            raise FilmError(f"{path}: MP4 needs an even width and height, got {width_px} x {height_px}")
        super().__init__(path, fps, width_px, height_px)
        self._crf = crf

    def _add_stream(self, container: Any) -> Any:
        import av
        from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc

        codec = "libx264" if "libx264" in av.codecs_available else "mpeg4"
        stream = container.add_stream(codec, rate=_fraction(self._fps))
        stream.pix_fmt = "yuv420p"
        if codec == "libx264":
            stream.options = {"crf": str(self._crf), "preset": "veryfast"}
        else:
            stream.bit_rate = max(1_000_000, int(4 * self._size[0] * self._size[1] * self._fps / 8))
        context = stream.codec_context
        context.colorspace, context.color_primaries = Colorspace.ITU709, ColorPrimaries.BT709
        context.color_trc, context.color_range = ColorTrc.IEC61966_2_1, ColorRange.MPEG
        return stream

    def _converted(self, frame: Any) -> Any:
        from av.video.reformatter import ColorRange, Colorspace

        return frame.reformat(
            format="yuv420p", dst_colorspace=Colorspace.ITU709, src_color_range=ColorRange.JPEG,
            dst_color_range=ColorRange.MPEG,
        )  # fmt: skip


class LosslessWriter(_FilmWriter):
    """Writer of a lossless 8-bit film: FFV1 in Matroska (RFC 9043, RFC 9559).

    The same frames give the same bytes.
    """

    def _add_stream(self, container: Any) -> Any:
        stream = container.add_stream("ffv1", rate=_fraction(self._fps))
        stream.pix_fmt = "bgr0"
        stream.codec_context.thread_count = 1
        stream.options = {"level": "3", "slicecrc": "1", "flags": "+bitexact"}
        return stream


def _fraction(fps: float):
    from fractions import Fraction

    return Fraction(fps).limit_denominator(1001)
