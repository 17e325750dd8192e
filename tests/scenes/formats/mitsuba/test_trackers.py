"""What reports in public trackers of Mitsuba turned up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenes.arithmetic import norm
from scenes.canonical import ConstantTexture, Matte, OrthographicCamera
from scenes.formats.conversion import load_scene_file
from scenes.formats.geometry.transform_stack import rotation
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import SENSOR

TURNED = rotation(30.0, 0.0, 1.0, 0.0)
UPRIGHT = np.diag([1.0, 2.0, 3.0, 1.0])


def _scene(folder: Path, body: str, report: LossReport | None = None):
    path = folder / "a.xml"
    path.write_text(f'<scene version="3.0.0">{SENSOR}{body}</scene>')
    return load_scene_file(path, None, report)


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        ('<rotate value="0, 1, 0" angle="30"/>', TURNED),
        ('<rotate y="1" angle="30"/>', TURNED),
        ('<matrix value="1 0 0  0 2 0  0 0 3"/>', UPRIGHT),
        ('<matrix value="1 0 0 0  0 2 0 0  0 0 3 0  0 0 0 1"/>', UPRIGHT),
        ('<scale value="1, 2, 3"/>', UPRIGHT),
    ],
)
def test_steps_of_a_transform_may_be_one_value(step: str, expected: np.ndarray, tmp_path: Path) -> None:
    scene = _scene(tmp_path, f'<shape type="cube"><transform name="to_world">{step}</transform></shape>')
    assert np.allclose(scene.instances[0].to_world, expected)


LOOK = '<lookat origin="1, 2, 6" target="0, 0, 0" up="0, 1, 0"/>'


def test_the_scale_of_a_parallel_view_is_the_size_of_its_picture(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    sensor = f'<sensor type="orthographic"><transform name="to_world"><scale x="3" y="3"/>{LOOK}</transform></sensor>'
    path.write_text(f'<scene version="3.0.0">{sensor}<shape type="sphere"/></scene>')
    camera = load_scene_file(path).camera
    assert isinstance(camera, OrthographicCamera) and camera.half_width == pytest.approx(3.0 * 576 / 768)
    assert np.allclose(camera.to_world[:3, :3].T @ camera.to_world[:3, :3], np.eye(3))


@pytest.mark.parametrize(
    ("scale", "factor"), [('value="3"', 3.0), ('x="3" y="1" z="1"', 1.0), ('x="1" y="1" z="3"', 3.0)]
)
def test_a_directional_light_is_as_bright_as_its_axis_is_long(scale: str, factor: float, tmp_path: Path) -> None:
    placed = f'<transform name="to_world"><scale {scale}/><rotate x="1" angle="70"/></transform>'
    scene = _scene(tmp_path, f'<emitter type="directional">{placed}<rgb name="irradiance" value="2 1 .5"/></emitter>')
    assert scene.lights[0].irradiance == pytest.approx((2.0 * factor, factor, 0.5 * factor))


@pytest.mark.parametrize(("kind", "scale", "lost"), [
    ("spot", 'x="1" y="3" z="1"', "a spot light that a transform stretches"),
    ("spot", 'value="3"', None),
    ("envmap", 'value="3"', "an environment map that its transform scales"),
    ("envmap", 'x="-1" y="1" z="1"', None),
])  # fmt: skip
def test_scaled_lights_are_named(kind: str, scale: str, lost: str | None, tmp_path: Path) -> None:
    Image.fromarray(np.zeros((2, 4, 3), np.uint8)).save(tmp_path / "a.png")
    placed = f'<transform name="to_world"><scale {scale}/>{LOOK}</transform>'
    picture = '<string name="filename" value="a.png"/>' if kind == "envmap" else ""
    report = LossReport()
    scene = _scene(tmp_path, f'<emitter type="{kind}">{placed}{picture}</emitter>', report=report)
    assert [loss.what for loss in report.losses] == ([lost] if lost else [])
    if kind == "envmap":
        assert norm(scene.lights[0].to_world[:3, 0]) == pytest.approx(1.0)


def test_of_repeated_properties_the_last_counts(tmp_path: Path) -> None:
    """Mitsuba 0.5 overwrites a property with a warning."""
    color = '<rgb name="reflectance" value="{0} {0} {0}"/>'
    body = f'<bsdf type="diffuse">{color.format(0.25)}{color.format(0.5)}</bsdf>'
    report = LossReport()
    scene = _scene(tmp_path, f'<shape type="sphere">{body}</shape>', report)
    assert scene.instances[0].material == Matte(ConstantTexture((0.5, 0.5, 0.5)))
    assert [(loss.what, loss.became, loss.picture) for loss in report.losses] == [
        ("diffuse: several values of 'reflectance'", "the last", False)
    ]
