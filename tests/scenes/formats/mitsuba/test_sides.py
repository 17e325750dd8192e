"""Sides of Mitsuba's shapes: spheres inside out, and lamps without a material, as Mitsuba 3 draws them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import Rectangle
from scenes.formats.conversion import load_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import drawn, seen

VIEW = """<scene version="3.0.0"><integrator type="path"/><emitter type="constant"/><sensor type="perspective">
<transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>"""
FLIPPED = '<boolean name="flip_normals" value="true"/>'
PARTS = {
    "matte": '<bsdf type="diffuse"/>',
    "both": '<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>',
    "lamp": '<emitter type="area"><rgb name="radiance" value="3"/></emitter>',
    "glass": '<bsdf type="dielectric"><rgb name="specular_transmittance" value="0.5"/></bsdf>',
}


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("flip", ["", FLIPPED])
@pytest.mark.parametrize("scale", [1, -1])
def test_spheres_inside_out_look_as_in_mitsuba_3(scale: int, flip: str, part: str, tmp_path: Path) -> None:
    """Matte ones are black from outside, and lamps shine inwards alone; a lamp without a material reflects nothing."""
    place = f'<transform name="to_world"><scale x="{scale}"/></transform>'
    text = f'{VIEW}<shape type="sphere">{flip}{place}{PARTS[part]}</shape></scene>'
    (tmp_path / "a.xml").write_text(text)
    report = LossReport()
    scene = load_scene_file(tmp_path / "a.xml", None, report)
    inside_out = (scale < 0) != bool(flip)
    wanted = seen("mitsuba", tmp_path / "a.xml", 16, 64)[6:10, 6:10].mean()
    assert drawn(scene, "mitsuba", tmp_path, 16, 64)[6:10, 6:10].mean() == pytest.approx(wanted, abs=0.02)
    known = {"matte": 0.0 if inside_out else 0.5, "both": 0.5, "lamp": 0.0 if inside_out else 3.0}
    assert part == "glass" or wanted == pytest.approx(known[part], abs=0.02)
    assert inside_out <= ("a sphere inside out" in report.text() or part == "both")


def test_a_lamp_that_faces_the_other_way_is_a_rectangle(tmp_path: Path) -> None:
    """The renderer's lamps are rectangles, not meshes."""
    place = '<transform name="to_world"><translate x="1"/></transform>'
    (tmp_path / "a.xml").write_text(f'{VIEW}<shape type="rectangle">{FLIPPED}{place}{PARTS["lamp"]}</shape></scene>')
    (lamp,) = load_scene_file(tmp_path / "a.xml").instances
    assert isinstance(lamp.shape, Rectangle)
    np.testing.assert_array_equal(lamp.to_world[:3, 2:].T, [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def test_stretched_spheres_are_round_in_mitsuba(tmp_path: Path) -> None:
    place = '<transform name="to_world"><scale x="2"/></transform>'
    (tmp_path / "a.xml").write_text(f'{VIEW}<shape type="sphere">{place}{PARTS["both"]}</shape></scene>')
    report = LossReport()
    load_scene_file(tmp_path / "a.xml", None, report)
    (loss,) = report.losses
    assert loss.what == "a sphere that a transform stretches" and loss.picture
