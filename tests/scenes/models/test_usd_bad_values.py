"""Values of USD files that are not finite, and pictures that are missing."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import ConstantTexture, DirectionalLight, EnvironmentLight, MetallicRough, SceneError
from scenes.formats.losses import LossReport
from scenes.models import read_model, read_whole, usd_text
from scenes.models.sources import Sources
from tests.scenes.models.usd import BOUND, QUAD, READER, ST, material, mesh, texture, written

CURVE = """def BasisCurves "h" {{ uniform token type = "linear"
    int[] curveVertexCounts = [2]
    point3f[] points = [{}]
    float[] widths = [{}] }}"""


@pytest.mark.parametrize(
    ("body", "where"),
    [
        (mesh(BOUND) + material("float inputs:roughness = nan"), "/Mat/S.inputs:roughness"),
        (mesh(BOUND) + material("color3f inputs:diffuseColor = (1, inf, 0)"), "/Mat/S.inputs:diffuseColor"),
        (mesh() + 'def DistantLight "L" { float inputs:angle = nan }', "/L.inputs:angle"),
        (mesh() + 'def SphereLight "L" { float inputs:radius = nan }', "/L.inputs:radius"),
        (mesh() + 'def SphereLight "L" { float inputs:shaping:cone:angle = nan }', "/L.inputs:shaping:cone:angle"),
        (mesh() + 'def SphereLight "L" { float inputs:exposure = nan }', "/L.inputs:exposure"),
        (mesh() + 'def SphereLight "L" { float inputs:intensity = 1e38\n float inputs:exposure = 9 }', "light L"),
        (mesh() + 'def Camera "C" { float fStop = nan }', "camera C"),
        (mesh() + 'def Camera "C" { float focalLength = nan }', "camera C"),
        ('def Sphere "b" { color3f[] primvars:displayColor = [(nan, 0, 0)] }', "b: primvar displayColor"),
        (CURVE.format("(0, 0, 0), (nan, 1, 0)", "1, 1"), "h: points: expected finite numbers, got [nan, 1.0, 0.0]"),
        (CURVE.format("(0, 0, 0), (1, 1, 0)", "1, inf"), "h: widths: expected finite numbers, got [inf]"),
    ],
)
def test_values_that_are_not_finite_are_refused(body: str, where: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError) as refused:
        read_whole(written(tmp_path, body))
    said = str(refused.value)
    assert where in said and "in.usda" in said and "expected" in said and "\n" not in said


@pytest.mark.parametrize("wrong", ["(0, 0)", "{", "((0, 0, 0), 0, 0)"])
def test_messages_of_the_library_do_not_quote_the_file(wrong: str, tmp_path: Path) -> None:
    """OpenUSD quotes all that follows the fault, and names its own functions."""
    points = ", ".join([wrong, *(2000 * ["(0, 0, 1)"])])
    with pytest.raises(SceneError) as refused:
        read_whole(written(tmp_path, f'def Mesh "m" {{ point3f[] points = [{points}] }}'))
    said = str(refused.value)
    assert len(said) < 300 + len(str(tmp_path)) and "pxr" not in said and "\n" not in said, said


def test_lists_within_lists_are_refused_before_the_library_quotes_the_file_at_each_number(tmp_path: Path) -> None:
    """1 GB for a file of 0.6 MB."""
    for inside in ("1, [", "[", "(0, 1), 2e-3, [", "1, -inf, nan, [", "1, # one\n["):
        with pytest.raises(SceneError, match="1[01]:.*: expected numbers, got a list within a list"):
            read_whole(written(tmp_path, f'def Mesh "m" {{\n int[] a = [{inside} 0, 1]\n}}'))
    quoted = 'string doc = "= [1, [" # = [[\n string more = """= [1,\n [" """\n'
    read_whole(written(tmp_path, mesh(quoted)))


def test_the_search_for_lists_within_lists_takes_no_more_memory_than_the_file(tmp_path: Path) -> None:
    """2.1 GB for a file of 19 MB."""
    points = ", ".join(20_000 * ["(0.5, 0.25, -2e-3)"])
    sources = Sources(written(tmp_path, f'def Mesh "m" {{ point3f[] points = [{points} # end\n] }}'))
    tracemalloc.start()
    usd_text.refuse_nested(sources)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2 * sources.path.stat().st_size


def test_lights_without_an_angle_or_extent(tmp_path: Path) -> None:
    body = """def DistantLight "sun" { float inputs:angle = -1 }
    def RectLight "panel" { bool inputs:normalize = 1
        float3 xformOp:scale = (0, 1, 1)
        uniform token[] xformOpOrder = ["xformOp:scale"]
    }
    """
    report = LossReport()
    model = read_whole(written(tmp_path, mesh() + body), report)
    (sun,) = model.lights
    assert isinstance(sun, DirectionalLight) and sun.angle_deg == 0.0 and len(model.parts) == 1
    assert "panel: a light without extent" in report.text()


@pytest.mark.parametrize("name", ["normals", "primvars:normals"])
def test_normals_that_are_not_finite_are_those_of_the_face(name: str, tmp_path: Path) -> None:
    inside = f'normal3f[] {name} = [(nan, 0, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0)] (interpolation = "vertex")'
    report = LossReport()
    (part,) = read_model(written(tmp_path, mesh(inside, QUAD)), report)
    found = {tuple(normal) for normal in np.round(part.shape.normals, 4)}
    assert found == {(0.0, 0.0, 1.0), (0.0, 1.0, 0.0)}
    assert "quad: non-finite normals: those of the faces" in report.text()


@pytest.mark.parametrize("file", ["none.png", "none.<UDIM>.png", ""])
@pytest.mark.parametrize("given", [True, False])
def test_a_missing_picture_has_its_fallback(file: str, given: bool, tmp_path: Path) -> None:
    """By default that of UsdUVTexture, black and opaque."""
    fallback = "float4 inputs:fallback = (0.25, 0.5, 0.75, 1)" if given else ""
    node = texture("T", file, fallback, "float3 outputs:rgb\nfloat outputs:g")
    inputs = """color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>
            float inputs:roughness.connect = </Mat/T.outputs:g>"""
    report = LossReport()
    body = mesh(ST + BOUND) + material(inputs, node + READER)
    (part,) = read_model(written(tmp_path, body), report, facets=True)
    assert isinstance(part.material, MetallicRough)
    color, roughness = ((0.25, 0.5, 0.75), 0.5) if given else ((0.0, 0.0, 0.0), 0.0)
    assert part.material.base == ConstantTexture(color) and part.material.roughness == roughness
    name = file.replace("<UDIM>", "1001")
    assert f"material Mat: the picture {name!r}, which is missing: its fallback" in report.text()


def test_a_missing_environment_is_even(tmp_path: Path) -> None:
    dome = 'def DomeLight "d" { float inputs:intensity = 2\nasset inputs:texture:file = @gone.hdr@ }\n'
    report = LossReport()
    (light,) = read_whole(written(tmp_path, mesh() + dome), report).lights
    assert isinstance(light, EnvironmentLight) and (light.image == 2.0).all()
    assert "d: the picture 'gone.hdr', which is missing: even light" in report.text()
