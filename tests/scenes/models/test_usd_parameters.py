"""No property of the schemas of USD that the reader knows is lost in silence: each is set in turn, in every prim.

A change shows in the scene, in the report, or as an error; or the property is on the list of those without effect.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from scenes.models.usd_library import Gf, Sdf, Usd
from tests.scenes.formats.directives.test_parameters import made, shows
from tests.scenes.models.usd import BOUND, QUAD, READER, ST, material, mesh, texture, written

Sdr: Any = pytest.importorskip("pxr.Sdr")  # without types
NODES = READER + texture("T", "a.png")
CURVES = """uniform token type = "cubic"
    uniform token basis = "bspline"
    int[] curveVertexCounts = [7]
    point3f[] points = [(0, 0, 0), (1, 1, 0), (2, 0, 0), (3, 1, 0), (4, 0, 0), (5, 1, 0), (6, 0, 0)]
    float[] widths = [0.1] (interpolation = "constant")
"""
SUBSET = """def GeomSubset "x" { uniform token elementType = "face"
    uniform token familyName = "materialBind"
    int[] indices = [0]
    rel material:binding = </Mat> }
"""
MANY = """def PointInstancer "x" { int[] protoIndices = [0, 1]
    point3f[] positions = [(1, 0, 0), (5, 0, 0)]
    rel prototypes = [</x/p>, </x/q>]
    def Sphere "p" { }
    def Cube "q" { }
}
"""
SHAPES = "Sphere Cube Cylinder Cone Capsule Plane".split()
LIGHTS = "DistantLight SphereLight DiskLight RectLight DomeLight DomeLight_1".split()
PREVIEW = mesh(ST + BOUND) + material("color3f inputs:diffuseColor = (1, 0, 0)", NODES)
PICTURED = mesh(ST + BOUND) + material("color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>", NODES)
TURNED = PICTURED.replace("</Mat/R.outputs:result>", "</Mat/P.outputs:result>").replace(
    'def Shader "T"', 'def Shader "P" { uniform token info:id = "UsdTransform2d"\n'
    'float2 inputs:in.connect = </Mat/R.outputs:result>\nfloat2 outputs:result }\ndef Shader "T"'
)  # fmt: skip
"""A picture whose coordinates are transformed."""

NOTHING = {
    "extent", "proxyPrim", "guideRadius", "light:shaderId", "stereoRole",  # boxes, and what editors show
    "doubleSided",  # of surfaces that do not shine
    "light:materialSyncMode",  # of lights that are no meshes
    "ids",  # of instances that are all seen
    "UsdUVTexture: inputs:fallback", "UsdPrimvarReader_float2: inputs:fallback",  # of what is there
    "DomeLight: inputs:normalize", "DomeLight_1: inputs:normalize",  # without a size
    "collection:lightLink", "collection:shadowLink",  # groups, which have no value
    "collection:lightLink:includeRoot", "collection:shadowLink:includeRoot",
}  # fmt: skip
"""What changes no picture."""

WHOLE = "Cylinder_1", "Capsule_1"
"""Kinds that are reported as a whole."""

VALUES: dict[str, tuple[Any, ...]] = {
    "bool": (True, False), "float": (0.37, 3.0, 40.0, -0.2), "double": (0.37, 3.0, 40.0), "int": (1, 7),
    "string": ("nosuch", "st2"), "asset": (Sdf.AssetPath("b.png"),), "float2": (Gf.Vec2f(0.3, 0.7), Gf.Vec2f(2, 3)),
    "float3": (Gf.Vec3f(0.1, 0.2, 0.3),), "color3f": (Gf.Vec3f(0.1, 0.2, 0.3),), "normal3f": (Gf.Vec3f(0.6, 0, 0.8),),
    "float4": (Gf.Vec4f(0.1, 0.2, 0.3, 0.4),), "int[]": ([0], [1, 0], [3], [3, 1], [0, 1, 2], [3, 4], [0, 2, 3, 1]),
    "int64[]": ([0], [5, 3]), "float[]": ([0.3], [0.3, 0.4], 7 * [0.3]),
    "point3f[]": ([(0, 0, 0), (1, 0, 0), (1, 2, 0), (0, 1, 0)], [(1, 2, 3), (3, 2, 1)],
                 [(n, n * n, 0) for n in range(7)]),
    "normal3f[]": (4 * [(0.6, 0, 0.8)], 7 * [(0.6, 0, 0.8)]), "color3f[]": ([(0.1, 0.2, 0.3)],),
    "vector3f[]": (4 * [(0, 0, 1)],), "float3[]": ([(1, 2, 3), (3, 2, 1)],), "float4[]": ([(0, 0, 1, 2)],),
    "quath[]": ([Gf.Quath(0.6, 0.8, 0, 0)] * 2,), "quatf[]": ([Gf.Quatf(0.6, 0.8, 0, 0)] * 2,),
    "token[]": (["xformOp:translate", "xformOp:rotateX"],), "pathExpression": (Sdf.PathExpression("//none"),),
    "token": ("nosuch", "X", "Y", "clamp", "mirror", "raw", "sRGB", "st"),
}  # fmt: skip


def schema(kind: str, *apis: str) -> dict[str, tuple[str, tuple[Any, ...]]]:
    """Types of the properties of a prim, and values of them, by their names; relationships have the type ``rel``."""
    registry, found = Usd.SchemaRegistry(), {}
    definitions = [registry.FindConcretePrimDefinition(kind), *map(registry.FindAppliedAPIPrimDefinition, apis)]
    for definition in definitions:
        for name in definition.GetPropertyNames():
            spec = definition.GetSchemaAttributeSpec(name)
            if spec is None:
                found[name] = "rel", (Sdf.Path("/ball"), (Sdf.Path("/ball"), Sdf.Path("/x/p")))
                continue
            allowed = tuple(spec.allowedTokens or ())
            typed = str(spec.typeName)
            found[name] = typed, allowed or VALUES.get(typed, ())
    return found


def files() -> Iterator[tuple[str, str, str, dict[str, tuple[str, tuple[Any, ...]]]]]:
    """Kinds and paths of prims, texts of files that have them, and their properties."""
    move = "double3 xformOp:translate = (1, 2, 3)\nfloat xformOp:rotateX = 30\n"
    yield "Mesh", "/quad", mesh(move), schema("Mesh")
    smooth = mesh(
        """int[] creaseIndices = [0, 1, 2]
        int[] creaseLengths = [3]
        float[] creaseSharpnesses = [2]
        int[] cornerIndices = [3]
        float[] cornerSharpnesses = [2]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "faceVarying")
        """,
        QUAD.replace('"none"', '"catmullClark"').replace("[4]", "[3, 3]").replace("0, 1, 2, 3", "0, 1, 2, 0, 2, 3"),
    )
    yield "Mesh", "/quad", smooth.replace("(0, 1)]", "(0, 1), (0, 0), (1, 0)]"), schema("Mesh")
    for kind in SHAPES:
        yield kind, "/x", f'def {kind} "x" {{ {move} }}\n', schema(kind)
    yield "BasisCurves", "/x", f'def BasisCurves "x" {{ {CURVES}{move} }}\n', schema("BasisCurves")
    yield (
        "GeomSubset",
        "/quad/x",
        mesh(SUBSET) + material("color3f inputs:diffuseColor = (1, 0, 0)"),
        schema("GeomSubset"),
    )
    yield "Camera", "/x", f'def Camera "x" {{ {move}\nfloat focusDistance = 3\nfloat fStop = 2 }}\n', schema("Camera")
    yield "PointInstancer", "/x", MANY.replace("rel ", f"{move}rel "), schema("PointInstancer")
    for kind in LIGHTS:
        more = "float inputs:width = 2\n" if kind == "RectLight" else ""
        more += "asset inputs:texture:file = @a.png@\n" if kind.startswith("Dome") else ""
        for one in ("", "bool inputs:enableColorTemperature = 1\n", "float inputs:shaping:cone:angle = 50\n"):
            yield kind, "/x", f'def {kind} "x" {{ {move}{more}{one} }}\n', schema(kind, "ShapingAPI", "ShadowAPI")
    clear = material("float inputs:opacity = 0\nint inputs:useSpecularWorkflow = 1")
    shiny = material("color3f inputs:diffuseColor = (0, 0, 0)\nint inputs:useSpecularWorkflow = 1")
    coated = material("float inputs:clearcoat = 1")
    for text in (clear, shiny, coated):
        yield "UsdPreviewSurface", "/Mat/S", mesh(BOUND) + text, shader("UsdPreviewSurface")
    for path, text, node in (("/Mat/S", PREVIEW, "UsdPreviewSurface"), ("/Mat/T", PICTURED, "UsdUVTexture"),
                             ("/Mat/P", TURNED, "UsdTransform2d"),
                             ("/Mat/R", PICTURED, "UsdPrimvarReader_float2")):  # fmt: skip
        yield node, path, text, shader(node)


def shader(kind: str) -> dict[str, tuple[str, tuple[Any, ...]]]:
    """Types of the inputs of a shader, and values of them, by their names."""
    node, found = Sdr.Registry().GetShaderNodeByIdentifier(kind), {}
    for name in node.GetShaderInputNames():
        given = node.GetShaderInput(name)
        typed = str(given.GetTypeAsSdfType().GetSdfType())
        found[f"inputs:{name}"] = typed, tuple(one[0] for one in given.GetOptions()) or VALUES.get(typed, ())
    return found


def silent(folder: Path) -> list[str]:
    """Kinds of prims, and properties of them whose change has no effect in any of the files."""
    for seed, name in enumerate(("a.png", "b.png")):
        Image.fromarray(np.random.default_rng(seed).integers(0, 256, (4, 4, 3), np.uint8)).save(folder / name)
    found, known = set[str](), set[str]()
    for kind, path, text, properties in files():
        file = written(folder, text + 'def Sphere "ball" { }\n')
        before, layer = made(file.read_text(), file), file.read_text()
        assert before is not None, text
        for name, (typed, values) in properties.items():
            label = f"{kind}: {name}"
            if {name, label} & NOTHING or label in known:
                continue
            assert values, (kind, name, typed)
            shown = any(shows(before, made(with_value(layer, path, name, typed, one), file)) for one in values)
            (known if shown else found).add(label)
    return sorted(found - known)


def with_value(text: str, path: str, name: str, typed: str, value: Any) -> str:
    """The file with another value of a property."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(text)
    prim = layer.GetPrimAtPath(path)
    if typed == "rel":
        spec = prim.relationships.get(name) or Sdf.RelationshipSpec(prim, name, False)
        spec.targetPathList.explicitItems = list(value) if isinstance(value, tuple) else [value]
    else:
        spec = prim.attributes.get(name) or Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.Find(typed))
        spec.connectionPathList.ClearEdits()
        spec.default = value
    return layer.ExportToString()


def test_no_property_is_lost_in_silence(tmp_path: Path) -> None:
    assert silent(tmp_path) == []


@pytest.mark.parametrize("kind", WHOLE)
def test_kinds_without_a_counterpart_are_reported(kind: str, tmp_path: Path) -> None:
    file = written(tmp_path, f'def {kind} "x" {{ }}\n{mesh()}')
    found = made(file.read_text(), file)
    assert found is not None and any(kind in loss for loss in found[1])
