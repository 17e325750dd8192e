"""Headers of Radiance pictures: order of rows and columns, exposure, colour correction, primaries and CIE XYZ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from scenes.canonical import SceneError
from scenes.chromaticities import REC_709, to_rec709
from scenes.formats.appearance.spectra import XYZ_TO_RGB
from scenes.loading import read_image, read_values
from tests.scenes.test_pictures import radiance

GREY = bytes((8, 8, 8, 136))
"""A pixel of value 8."""


def picture(folder: Path, lines: str = "", pixels: bytes = GREY, size: str = "-Y 1 +X 1", kind: str = "rgbe") -> Path:
    path = folder / "a.hdr"
    head = f"#?RADIANCE\n{lines}FORMAT=32-bit_rle_{kind}\n\n{size}\n"
    path.write_bytes(head.encode() + pixels)
    return path


@pytest.mark.parametrize("first", ["-Y 2", "+Y 2", "+X 3", "-X 3"])
@pytest.mark.parametrize("forward", [True, False])
def test_rows_and_columns_in_any_order(first: str, forward: bool, tmp_path: Path) -> None:
    """The first axis is that of scan lines; Y goes up, and X to the right."""
    if "Y" in first:
        size = f"{first} {'+' if forward else '-'}X 3"
        expected = np.arange(1.0, 7.0).reshape(2, 3)
        expected = expected[:: 1 if first[0] == "-" else -1, :: 1 if forward else -1]
    else:
        size = f"{first} {'-' if forward else '+'}Y 2"
        expected = np.arange(1.0, 7.0).reshape(3, 2).T
        expected = expected[:: 1 if forward else -1, :: 1 if first[0] == "+" else -1]
    pixels = b"".join(bytes((value, 0, 0, 136)) for value in range(1, 7))
    found = read_image(picture(tmp_path, pixels=pixels, size=size))
    np.testing.assert_array_equal(found[..., 0], expected)


@pytest.mark.parametrize("ending", [".hdr", ".pic", ".rgbe"])
def test_values_are_divided_by_exposures_and_corrections(ending: str, tmp_path: Path) -> None:
    """Each tool appends a line; the product counts."""
    lines = "rpict -vf view\nEXPOSURE= 2.0\nCOLORCORR=1 2 4\nEXPOSURE=0.5e0\nEXPOSURE=2\nCOLORCORR= 2 2 2\n"
    path = picture(tmp_path, lines).rename(tmp_path / f"a{ending}")
    assert read_image(path)[0, 0].tolist() == [2.0, 1.0, 0.5] and read_values(path)[0, 0].tolist() == [2.0, 1.0, 0.5]


@pytest.mark.parametrize("lines", ["EXPOSURE=0\n", "EXPOSURE=1e-60\n", "EXPOSURE=1e60\n", "EXPOSURE=-1\n",
                                   "EXPOSURE=x\n", "EXPOSURE=1 2\n", "EXPOSURE=nan\n", "COLORCORR=1 2\n",
                                   "PRIMARIES=1 2 3\n"])  # fmt: skip
def test_numbers_that_a_header_cannot_have_are_one_line(lines: str, tmp_path: Path) -> None:
    with pytest.raises(
        SceneError, match=r"a\.hdr: cannot be read: expected (\d numbers behind|exposures from 1e-30 to 1e\+30, got)"
    ) as error:
        read_image(picture(tmp_path, lines))
    assert "\n" not in str(error.value)


def test_primaries_are_converted_and_white_stays_white(tmp_path: Path) -> None:
    """The green of wide primaries (Rec. 2020) is beyond Rec. 709, (-0.588, 1.133, -0.101) there."""
    wide = "PRIMARIES=0.708 0.292 0.170 0.797 0.131 0.046 0.3127 0.3290\n"
    green = read_image(picture(tmp_path, wide, bytes((0, 8, 0, 136))))[0, 0]
    assert green == pytest.approx([0.0, 8.0 * 1.13290, 0.0], abs=1e-3)
    assert read_image(picture(tmp_path, wide))[0, 0] == pytest.approx([8.0] * 3, rel=1e-6)
    assert read_values(picture(tmp_path, wide, bytes((0, 8, 0, 136))))[0, 0].tolist() == [0.0, 8.0, 0.0], "numbers"
    for lines in ("PRIMARIES=0 0 0 0 0 0 0 0\n", "PRIMARIES=" + " ".join(map(str, REC_709)) + "\n"):
        assert read_image(picture(tmp_path, lines, bytes((0, 8, 0, 136))))[0, 0].tolist() == [0.0, 8.0, 0.0]


def test_pictures_in_xyz(tmp_path: Path) -> None:
    """White of equal energy is white; a light of luminance alone is a green beyond Rec. 709."""
    assert read_image(picture(tmp_path, kind="xyze"))[0, 0] == pytest.approx([8.0] * 3, rel=1e-6)
    luminance = read_image(picture(tmp_path, pixels=bytes((0, 8, 0, 136)), kind="xyze"))[0, 0].tolist()
    assert luminance[0] == luminance[2] == 0.0 and luminance[1] > 8.0
    path = tmp_path / "a.hdr"
    path.write_bytes(radiance(GREY, 1, 1).replace(b"32-bit_rle_rgbe", b"64-bit"))
    with pytest.raises(SceneError, match="cannot be read"):
        read_image(path)


def wide_exr(folder: Path) -> Path:
    """A picture of one pixel, the green of wide primaries."""
    values = {name: np.full((1, 1), value, np.float32) for name, value in zip("RGB", (0.0, 1.0, 0.0), strict=True)}
    header = {"chromaticities": (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)}
    OpenEXR.File({"type": OpenEXR.scanlineimage, **header}, values).write(str(folder / "a.exr"))
    return folder / "a.exr"


def test_openexr_names_primaries_too(tmp_path: Path) -> None:
    assert read_image(wide_exr(tmp_path))[0, 0] == pytest.approx([0.0, 1.13290, 0.0], abs=1e-4)
    assert read_values(tmp_path / "a.exr")[0, 0].tolist() == [0.0, 1.0, 0.0]


def test_matrices_of_known_primaries() -> None:
    """CIE XYZ of D65 gives the published matrix of Rec. 709; that matrix has four digits of the white."""
    found = to_rec709((1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.3127, 0.3290))
    assert found is not None
    white = np.array([0.3127 / 0.3290, 1.0, (1.0 - 0.3127 - 0.3290) / 0.3290])
    np.testing.assert_allclose(found / white, XYZ_TO_RGB, atol=2e-3)
    assert to_rec709(REC_709) is None and to_rec709((0.0,) * 8) is None
