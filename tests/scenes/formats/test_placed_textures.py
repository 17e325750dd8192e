"""Pictures that are scaled and moved over surfaces, as each renderer draws them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    EnvironmentLight,
    Film,
    ImageTexture,
    Instance,
    Integrator,
    Matte,
    PerspectiveCamera,
    Rectangle,
    Scene,
)
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import seen

SIDE_PX, FINE = 24, 8
IMAGE = np.kron(np.random.default_rng(0).uniform(0.1, 0.9, (4, 4, 3)), np.ones((16, 16, 1))).astype(np.float32)
PLACES = [((1.0, 1.0), (0.0, 0.0)), ((2.0, -1.5), (0.25, 0.5)), ((-2.0, 3.0), (0.5, 0.5)), ((1.5, 1.0), (0.0, 0.25))]
"""Scales and offsets along u and v."""


def albedo(scale: tuple[float, float], offset: tuple[float, float]) -> np.ndarray:
    """What a square shows of the picture, ``(SIDE_PX, SIDE_PX, 3)``."""
    along = (np.arange(SIDE_PX * FINE) + 0.5) / (SIDE_PX * FINE)
    columns = ((along * scale[0] + offset[0]) % 1.0 * 64).astype(int)
    rows = 63 - ((along[::-1] * scale[1] + offset[1]) % 1.0 * 64).astype(int)
    return IMAGE[rows[:, None], columns[None]].reshape(SIDE_PX, FINE, SIDE_PX, FINE, 3).mean((1, 3))


def squares() -> Scene:
    """Squares side by side under an even light, each with the picture in another place."""
    shown = []
    for number, (scale, offset) in enumerate(PLACES):
        place = np.eye(4)
        place[0, 3] = 2 * number - (len(PLACES) - 1)
        shown.append(Instance(Rectangle(), Matte(ImageTexture(IMAGE, scale, offset, filter="bilinear")), place))
    view = np.eye(4)
    view[2, 3] = 100.0
    light = EnvironmentLight(np.ones((1, 1, 3), np.float32))
    film = Film(SIDE_PX * len(PLACES), SIDE_PX)
    camera = PerspectiveCamera(view, 2.0 * np.degrees(np.arctan(0.01)))
    return Scene(camera, tuple(shown), (light,), film, integrator=Integrator("path", 4))


@pytest.mark.parametrize(
    ("to", "ending", "program"),
    [("mitsuba", ".xml", "mitsuba"), ("mitsuba3", ".xml", "mitsuba"), ("luxrender", ".lxs", "luxcore")],
)
def test_pictures_lie_where_the_scene_has_them(to: str, ending: str, program: str, tmp_path: Path) -> None:
    file, report = tmp_path / f"a{ending}", LossReport()
    save_scene_file(squares(), file, to, report)
    assert not [loss for loss in report.losses if loss.picture and "offset" in loss.what]
    picture = seen(program, file, (SIDE_PX * len(PLACES), SIDE_PX), 32)
    inside = slice(2, -2)
    for number, place in enumerate(PLACES):
        cell = picture[inside, SIDE_PX * number : SIDE_PX * (number + 1)][:, inside]
        assert np.abs(cell - albedo(*place)[inside, inside]).mean() < 0.03, place


def losses_of(texture: ImageTexture, file: Path, to: str | None = None) -> tuple[list[str], ImageTexture]:
    """What a format loses of a texture, and what is read again."""
    report = LossReport()
    save_scene_file(Scene(PerspectiveCamera(), (Instance(Rectangle(), Matte(texture)),)), file, to, report)
    (again,) = load_scene_file(file).instances
    lost = [str(loss) for loss in report.losses if "picture" in str(loss) or "offset" in str(loss)]
    return lost, again.material.reflectance  # type: ignore[union-attr]


def test_luxcore_repeats_pictures_and_has_one_offset(tmp_path: Path) -> None:
    file = tmp_path / "a.lxs"
    assert losses_of(ImageTexture(IMAGE, wrap="clamp"), file)[0] == [
        "texture picture: what lies beyond the edges of a picture (clamp): repeated in LuxCore"
    ]
    lost, kept = losses_of(ImageTexture(IMAGE, uv_offset=(0.1, 0.25)), file)
    assert lost == ["texture picture: an offset along v that is not that along u: that along u in LuxCore"]
    assert kept.uv_offset == pytest.approx((0.1, 0.25))
    assert losses_of(ImageTexture(IMAGE, uv_offset=(0.5, 0.5)), file)[0] == []
    lost, moved = losses_of(ImageTexture(IMAGE, uv_offset=(0.0, 0.25)), file)
    assert lost == [] and moved.uv_offset == (0.0, 1.0)
    np.testing.assert_array_equal(moved.image, np.roll(IMAGE, 16, axis=0))


def test_mitsuba_3_has_no_black_beyond_a_picture(tmp_path: Path) -> None:
    lost, again = losses_of(ImageTexture(IMAGE, wrap="black"), tmp_path / "a.xml", "mitsuba3")
    assert lost == ["reflectance: a picture that is black beyond its border: the colours of its border"]
    assert again.wrap == "clamp"
    lost, again = losses_of(ImageTexture(IMAGE, wrap="black"), tmp_path / "a.xml", "mitsuba")
    assert lost == [] and again.wrap == "black"
