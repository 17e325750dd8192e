"""USD files: meshes, transforms and instances as the format defines them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.animation import pose_at
from scenes.canonical import (
    ConstantTexture,
    Cube,
    Instance,
    Rectangle,
    Sphere,
)
from scenes.catalog import Look, load_seen
from scenes.formats.losses import LossReport
from scenes.models import read_model, read_whole
from tests.scenes.models.usd import QUAD, ST, material, mesh, written


def world(part: Instance, time_s: float = 0.0) -> np.ndarray:
    """The corners of the triangles of a part."""
    matrix = part.to_world if part.track is None else pose_at(part.track, time_s) @ part.to_world
    return part.shape.vertices[part.shape.faces].astype(float) @ matrix[:3, :3].T + matrix[:3, 3]


def area_normal(part: Instance) -> np.ndarray:
    corners = world(part)
    return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)


def test_polygons_holes_and_orientation(tmp_path: Path) -> None:
    """A pentagon of area 5, a hole, and an edge, which is no face."""
    points = "[(0,0,0),(2,0,0),(2,2,0),(1,3,0),(0,2,0),(9,9,9)]"
    shape = f"""
        int[] faceVertexCounts = [5, 3, 2]
        int[] faceVertexIndices = [0, 1, 2, 3, 4, 0, 1, 5, 0, 5]
        int[] holeIndices = [1]
        point3f[] points = {points}
        uniform token subdivisionScheme = "none"
    """
    report = LossReport()
    (part,) = read_model(written(tmp_path, mesh(shape=shape)), report)
    assert part.shape.faces.shape == (3, 3) and len(part.shape.vertices) == 5 and part.shape.normals is None
    assert area_normal(part) == pytest.approx((0.0, 0.0, 5.0))
    assert [(loss.what, loss.became) for loss in report.losses] == [
        ("faces of fewer than three corners (1)", "left out")
    ]
    left = written(tmp_path, mesh('uniform token orientation = "leftHanded"', shape), "left.usda")
    assert area_normal(read_model(left)[0]) == pytest.approx((0.0, 0.0, -5.0))


def test_concave_polygons_are_covered_once(tmp_path: Path) -> None:
    """A dart of area 1.5 whose fan about its first corner covers 2 and turns a triangle over."""
    shape = """
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0,0,0),(2,1,0),(0,2,0),(0.5,1,0)]
        uniform token subdivisionScheme = "none"
    """
    (part,) = read_model(written(tmp_path, mesh(shape=shape)))
    corners = world(part)
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert (areas > 0.0).all() and areas.sum() == pytest.approx(1.5)


def test_subsets_have_their_own_materials(tmp_path: Path) -> None:
    shape = """
        int[] faceVertexCounts = [3, 3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3, 0, 1, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
        uniform token subdivisionScheme = "none"
        rel material:binding = </Red>
        def GeomSubset "some" {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1]
            rel material:binding = </Mat>
        }
    """
    both = material("color3f inputs:diffuseColor = (0, 1, 0)") + material(
        "color3f inputs:diffuseColor = (1, 0, 0)", name="Red"
    )
    some, rest = read_model(written(tmp_path, mesh(shape=shape) + both))
    assert some.material.diffuse == ConstantTexture((0.0, 1.0, 0.0)) and len(some.shape.faces) == 1
    assert rest.material.diffuse == ConstantTexture((1.0, 0.0, 0.0)) and len(rest.shape.faces) == 2


def test_colours_of_display_by_their_interpolation(tmp_path: Path) -> None:
    def parts(inside: str):
        report = LossReport()
        return read_model(written(tmp_path, mesh(inside), f"{abs(hash(inside))}.usda"), report)[0], report

    assert parts("")[0].material.diffuse.value == pytest.approx((0.18, 0.18, 0.18))
    one, _ = parts("color3f[] primvars:displayColor = [(0.2, 0.4, 0.6)]")
    assert one.material.diffuse.value == pytest.approx((0.2, 0.4, 0.6))
    for kind, count in (("uniform", 1), ("vertex", 4), ("faceVarying", 4)):
        values = ", ".join(f"({0.1 * (at + 1)}, 0.5, 0.5)" for at in range(count))
        part, report = parts(f'color3f[] primvars:displayColor = [{values}] (interpolation = "{kind}")')
        assert not report.losses
        if kind == "uniform":
            assert part.material.diffuse.value == pytest.approx((0.1, 0.5, 0.5))
        else:
            found = np.round(part.material.diffuse.image[..., 0], 4)
            assert all(np.float32(0.1 * (at + 1)) in found for at in range(4))
    _, report = parts('color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (interpolation = "vertex")')
    assert "primvar displayColor (vertex) with 2 values" in report.text()
    indexed = """color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (interpolation = "vertex")
        int[] primvars:displayColor:indices = [0, 1, 1, 0]"""
    spread = 'color3f[] primvars:displayColor = [(1,0,0), (0,1,0), (0,1,0), (1,0,0)] (interpolation = "vertex")'
    one, other = (parts(inside)[0].material.diffuse.image for inside in (indexed, spread))
    assert len(np.unique(one.reshape(-1, 3), axis=0)) >= 2 and (one == other).all()


def test_transforms_move_what_hangs_below(tmp_path: Path) -> None:
    """A quarter turn about z in one second, on a carrier that moves by 2 a second, scaled by 2."""
    inner = mesh(shape=QUAD)
    body = f"""def Xform "car" {{
        double3 xformOp:translate.timeSamples = {{ 0: (0, 0, 0), 24: (2, 0, 0) }}
        float3 xformOp:scale = (2, 2, 2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
        def Xform "wheel" {{
            float xformOp:rotateZ.timeSamples = {{ 0: 0, 24: 90 }}
            uniform token[] xformOpOrder = ["xformOp:rotateZ"]
            {inner}
        }}
    }}
    """
    report = LossReport()
    model = read_whole(written(tmp_path, body, end=24), report)
    (part,) = model.parts
    assert not report.losses and part.track is not None
    for time_s in (0.0, 0.5, 1.0, 7.0):
        t = min(time_s, 1.0)
        turn = np.radians(90.0 * t)
        first = 2.0 * np.array([np.sin(turn) - np.cos(turn), -np.sin(turn) - np.cos(turn), 0.0]) + (2.0 * t, 0.0, 0.0)
        np.testing.assert_allclose(world(part, time_s)[0, 0], first, atol=2e-4)
    scene, _ = load_seen(str(tmp_path / "in.usda"), Look())
    assert scene.duration_s == pytest.approx(1.0)


def test_what_grows_or_bends_keeps_its_start_with_a_loss(tmp_path: Path) -> None:
    grow = """float3 xformOp:scale.timeSamples = { 0: (1, 1, 1), 24: (2, 2, 2) }
        uniform token[] xformOpOrder = ["xformOp:scale"]"""
    bend = QUAD.replace("points = ", "points.timeSamples = { 0: ").replace("(-1, 1, 0)]", "(-1, 1, 0)], 24: [] }")
    report = LossReport()
    body = f'def Xform "a" {{ {grow}\n {mesh()} }}\n' + mesh(shape=bend, name="bent")
    first, second = read_model(written(tmp_path, body, end=24), report)
    assert first.track is None and len(second.shape.faces) == 2
    assert (
        "an animation that scales or shears" in report.text()
        and "values that change (points): those at 0 s" in report.text()
    )


def test_instances_share_their_mesh(tmp_path: Path) -> None:
    body = f"""class "Proto" {{ {mesh()} }}
    def Xform "a" (instanceable = true
        inherits = </Proto>) {{ }}
    def Xform "b" (instanceable = true
        inherits = </Proto>) {{
        double3 xformOp:translate = (5, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    """
    first, second = read_model(written(tmp_path, body))
    assert first.shape is second.shape and second.to_world[0, 3] == 5.0


def test_point_instances(tmp_path: Path) -> None:
    body = f"""def PointInstancer "many" {{
        double3 xformOp:translate = (0, 0, 7)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        int[] protoIndices = [0, 1, 0, 1]
        point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)]
        float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 1, 1), (1, 1, 1)]
        int64[] invisibleIds = [2]
        rel prototypes = [</many/p/quad>, </many/p/ball>]
        def Scope "p" {{
            {mesh()}
            def Sphere "ball" {{
                double3 xformOp:translate = (0, 0, 0.25)
                uniform token[] xformOpOrder = ["xformOp:translate"]
            }}
        }}
    }}
    """
    parts = read_model(written(tmp_path, body))
    assert len(parts) == 3 and sum(isinstance(part.shape, Sphere) for part in parts) == 2
    places = {type(part.shape).__name__ + str(part.to_world[0, 3]): part.to_world for part in parts}
    assert places["Mesh0.0"][:3, 3] == pytest.approx((0, 0, 7))
    assert places["Sphere1.0"][:3, 3] == pytest.approx((1, 0, 7.5)) and places["Sphere1.0"][0, 0] == 2.0
    assert places["Sphere3.0"][:3, 3] == pytest.approx((3, 0, 7.25))


def test_primitives_have_their_size(tmp_path: Path) -> None:
    sizes = {"Cylinder": (2.0, 2.0, 3.0), "Cone": (2.0, 2.0, 3.0), "Capsule": (2.0, 2.0, 5.0)}
    body = "".join(f'def {kind} "{kind}" {{ double height = 3\n double radius = 1\n }}\n' for kind in sizes)
    body += 'def Cube "c" { double size = 3 }\ndef Plane "p" { double width = 4\n double length = 2\n }\n'
    body += 'def Cylinder "x" { double height = 3\n token axis = "X"\n }\n def NurbsPatch "n" { }\n'
    report = LossReport()
    parts = read_model(written(tmp_path, body), report)
    assert "n: a prim of kind NurbsPatch" in report.text()
    named: dict[str, list[Instance]] = {}
    for part in parts:
        named.setdefault(part.name.partition("/")[2], []).append(part)
    for kind, extent in sizes.items():
        points = np.concatenate([world(part).reshape(-1, 3) for part in named[kind]])
        np.testing.assert_allclose(np.ptp(points, axis=0), extent, atol=0.01)
        np.testing.assert_allclose(points.min(axis=0) + points.max(axis=0), 0.0, atol=0.01)
        for part in named[kind]:  # closed, and its outside is outside
            corners = world(part)
            outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            assert ((outward * corners.mean(axis=1)).sum(axis=1) > -1e-6).all()
    along = np.concatenate([world(part).reshape(-1, 3) for part in named["x"]])
    np.testing.assert_allclose(np.ptp(along, axis=0), (3.0, 2.0, 2.0), atol=0.01)
    (cube,), (plane,) = named["c"], named["p"]
    assert isinstance(cube.shape, Cube) and cube.to_world[0, 0] == 1.5
    assert isinstance(plane.shape, Rectangle) and (plane.to_world[0, 0], plane.to_world[1, 1]) == (2.0, 1.0)


def test_what_is_not_shown(tmp_path: Path) -> None:
    body = "".join(mesh(extra, name=f"m{number}") for number, extra in enumerate(
        ('token visibility = "invisible"', 'uniform token purpose = "proxy"', 'uniform token purpose = "render"', "")
    ))  # fmt: skip
    assert [part.name for part in read_model(written(tmp_path, body))] == ["in/m2", "in/m3"]


def test_a_skeleton_bends_its_mesh(tmp_path: Path) -> None:
    """One joint lifts all points by 3 at the start."""
    bound = """
        prepend apiSchemas = ["SkelBindingAPI"]
    """
    body = f"""def SkelRoot "root" {{
        def Skeleton "skel" {{
            uniform token[] joints = ["a"]
            uniform matrix4d[] bindTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1))]
            uniform matrix4d[] restTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,3,1))]
        }}
        def Mesh "quad" ({bound}) {{{QUAD}
            rel skel:skeleton = </root/skel>
            int[] primvars:skel:jointIndices = [0, 0, 0, 0] (elementSize = 1
                interpolation = "vertex")
            float[] primvars:skel:jointWeights = [1, 1, 1, 1] (elementSize = 1
                interpolation = "vertex")
        }}
    }}
    """
    (part,) = read_model(written(tmp_path, body))
    assert world(part)[..., 2] == pytest.approx(3.0)
    assert "timeSamples" not in (tmp_path / "in.usda").read_text()


def test_normals_and_coordinates(tmp_path: Path) -> None:
    inside = ST + 'normal3f[] normals = [(0, 0, 2), (0, 0, 2), (0, 1, 1), (0, 0, 0)] (interpolation = "vertex")'
    (part,) = read_model(written(tmp_path, mesh(inside)))
    assert part.shape.normals is not None and part.shape.uvs is None, "no texture reads the coordinates"
    np.testing.assert_allclose(np.linalg.norm(part.shape.normals, axis=1), 1.0, atol=1e-6)
