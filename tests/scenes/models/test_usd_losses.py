"""What USD files hold and models do not is listed."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenes.formats.losses import LossReport
from scenes.models import read_model
from tests.scenes.models.usd import BOUND, material, mesh, written

BALL = 'def Sphere "ball" { }\n'
MANY = """def PointInstancer "many" {{
        int[] protoIndices = [0, 0]
        point3f[] positions = [(1, 0, 0), (5, 0, 0)]
        rel prototypes = [</many/p>]
        {more}
        {inside}
    }}
"""
PLAIN = 'def Sphere "p" { }'
MOVING = 'def Sphere "p" { double3 xformOp:translate.timeSamples = {0: (0, 0, 0), 24: (1, 0, 0)}\n'
MOVING += 'uniform token[] xformOpOrder = ["xformOp:translate"] }'
PULSE = "color3f inputs:diffuseColor.timeSamples = {0: (1, 0, 0), 24: (0, 1, 0)}"
ALONE = 'uniform token light:materialSyncMode = "noMaterialResponse"\n'

CASES = {
    "the light of a mesh": mesh(ALONE).replace("Mesh", 'Mesh "quad" (prepend apiSchemas = ["MeshLightAPI"])', 1)
    .replace(' "quad" {', " {", 1),
    "an opacity without a material": mesh("float[] primvars:displayOpacity = [0.5]"),
    "2 polygons that the mesh does not have": mesh("""
        def GeomSubset "part" { uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [0, 99, -5] }
    """),
    "colours of single instances": MANY.format(inside=PLAIN, more="color3f[] primvars:displayColor = "
                                               '[(1, 0, 0), (0, 1, 0)] (interpolation = "vertex")'),
    "motion within the prototype p": MANY.format(inside=MOVING, more=""),
    "instances that move": MANY.format(inside=PLAIN, more="float3[] scales.timeSamples = "
                                       "{0: [(1, 1, 1), (1, 1, 1)], 24: [(2, 2, 2), (2, 2, 2)]}"),
    "values that change (inputs:intensity)":
        BALL + 'def SphereLight "l" { float inputs:intensity.timeSamples = {0: 1, 24: 5} }\n',
    "values that change (focalLength)":
        BALL + 'def Camera "c" { float focalLength.timeSamples = {0: 35, 24: 70} }\n',
    "values that change (inputs:diffuseColor)": mesh(BOUND) + material(PULSE),
}  # fmt: skip


@pytest.mark.parametrize("loss", CASES)
def test_losses_are_listed(loss: str, tmp_path: Path) -> None:
    report = LossReport()
    read_model(written(tmp_path, CASES[loss], end=24), report)
    assert loss in report.text(), report.text()


def test_a_plain_file_has_none(tmp_path: Path) -> None:
    report = LossReport()
    body = mesh(BOUND) + material("color3f inputs:diffuseColor = (1, 0, 0)") + MANY.format(inside=PLAIN, more="")
    read_model(written(tmp_path, body), report)
    assert not report.text()
