"""Skeletons and values over time of USD files at a time."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenes.formats.comparison import difference
from scenes.formats.losses import LossReport
from scenes.models import read_whole
from tests.scenes.models.files import QUAD
from tests.scenes.models.test_poses import same_points, turned
from tests.scenes.models.usd import BOUND, READER, ST, material, mesh, texture, written

pytest.importorskip("pxr")

SKELETON = """
def SkelRoot "Root" {
    def Skeleton "Bones" (
        prepend apiSchemas = ["SkelBindingAPI"]
    ) {
        uniform token[] joints = ["a", "a/b"]
        uniform matrix4d[] bindTransforms = [
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 0, 0, 1))]
        uniform matrix4d[] restTransforms = [
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 0, 0, 1))]
        rel skel:animationSource = </Root/Anim>
    }
    def SkelAnimation "Anim" {
        uniform token[] joints = ["a", "a/b"]
        float3[] translations = [(0, 0, 0), (1, 0, 0)]
        quatf[] rotations.timeSamples = {
            0: [(1, 0, 0, 0), (1, 0, 0, 0)],
            24: [(1, 0, 0, 0), (0.70710678, 0, 0.70710678, 0)]
        }
        half3[] scales = [(1, 1, 1), (1, 1, 1)]
    }
    def Mesh "skinned" (
        prepend apiSchemas = ["SkelBindingAPI"]
    ) {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
        uniform token subdivisionScheme = "none"
        int[] primvars:skel:jointIndices = [0, 1, 1, 1] (
            elementSize = 1
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [1, 1, 1, 1] (
            elementSize = 1
            interpolation = "vertex"
        )
        rel skel:skeleton = </Root/Bones>
    }
}
"""


def test_a_skeleton_of_usd_has_its_pose_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "in.usda"
    written(tmp_path, "", end=24)
    path.write_text(path.read_text() + SKELETON)
    for time_s in (0.0, 0.25, 0.5, 1.0, 3.0):
        report = LossReport()
        model = read_whole(path, report, time_s=time_s)
        angle = min(time_s, 1.0) * math.pi / 2
        expected = [np.array(QUAD[0]), *(turned(angle, QUAD[number]) for number in (1, 2, 3))]
        same_points(model, np.array(expected), 1e-5)
        assert model.posed and f"a skeleton that moves: the pose at {time_s:g} s" in report.text()


def test_values_of_usd_are_those_at_the_time(tmp_path: Path) -> None:
    body = """def Mesh "quad" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points.timeSamples = {
            0: [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)],
            24: [(-1, -1, 8), (1, -1, 8), (1, 1, 8), (-1, 1, 8)]
        }
        uniform token subdivisionScheme = "none"
}
def SphereLight "lamp" {
        float inputs:intensity.timeSamples = { 0: 1, 24: 3 }
        double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 24: (4, 0, 0) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    path = tmp_path / "in.usda"
    written(tmp_path, "", end=24)
    path.write_text(path.read_text() + body)
    first, later = (read_whole(path, time_s=time_s) for time_s in (0.0, 0.5))
    (mesh, lamp), (mesh_later, lamp_later) = first.parts, later.parts
    assert (mesh.shape.vertices[:, 2] == 0.0).all() and (mesh_later.shape.vertices[:, 2] == 4.0).all()
    np.testing.assert_allclose(np.divide(lamp_later.emission, lamp.emission), 2.0)
    assert lamp.track is not None and lamp_later.track is not None, "rigid motion stays a motion"
    np.testing.assert_array_equal(lamp.to_world, lamp_later.to_world)


CURVE = """def BasisCurves "hair" { uniform token type = "linear"
    int[] curveVertexCounts = [2]
    point3f[] points%s = %s
    float[] widths%s = %s }
"""
MOVING_ST = """
        texCoord2f[] primvars:st (interpolation = "vertex")
        texCoord2f[] primvars:st.timeSamples = {
            0: [(0, 0), (1, 0), (1, 1), (0, 1)],
            24: [(0, 0), (0, 0), (0, 0), (1, 1)]
        }
"""
TEXTURED = material(
    "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>", texture("T", "t.png", more="%s") + READER
)
CHANGING = {
    "points": CURVE % (".timeSamples", "{0: [(0, 0, 0), (0, 1, 0)], 24: [(0, 0, 0), (2, 1, 0)]}", "", "[0.1, 0.1]"),
    "widths": CURVE % ("", "[(0, 0, 0), (0, 1, 0)]", ".timeSamples", "{0: [0.1, 0.1], 24: [0.3, 0.3]}"),
    "radius": 'def Sphere "ball" { double radius.timeSamples = {0: 1, 24: 2} }\n',
    "primvars:displayColor":
        'def Sphere "ball" { color3f[] primvars:displayColor.timeSamples = {0: [(1, 0, 0)], 24: [(0, 1, 0)]} }\n',
    "primvars:st": mesh(MOVING_ST + BOUND) + TEXTURED % "",
    "inputs:scale":
        mesh(ST + BOUND) + TEXTURED % "float4 inputs:scale.timeSamples = {0: (1, 1, 1, 1), 24: (0, 0, 0, 1)}",
}  # fmt: skip


@pytest.mark.parametrize("what", CHANGING)
def test_every_value_of_usd_that_changes_is_that_at_the_time(what: str, tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (255, 255, 255)).save(tmp_path / "t.png")
    path, report = written(tmp_path, CHANGING[what], end=24), LossReport()
    first, later = read_whole(path), read_whole(path, report, time_s=0.5)
    assert first.posed and f"values that change ({what}): those at 0.5 s" in report.text()
    assert difference(first.parts, later.parts) is not None
