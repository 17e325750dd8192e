"""USD files written by tests."""

from __future__ import annotations

from pathlib import Path

HEAD = """#usda 1.0
(
    upAxis = "{up}"
    metersPerUnit = {unit}
    startTimeCode = 0
    endTimeCode = {end}
    timeCodesPerSecond = 24
)
"""
QUAD = """
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
        uniform token subdivisionScheme = "none"
"""
ST = """
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
"""
BOUND = """
        rel material:binding = </Mat>
"""


def written(folder: Path, body: str, name: str = "in.usda", up: str = "Y", unit: float = 0.01, end: float = 0) -> Path:
    """A file with these prims."""
    path = folder / name
    # a statement ends with its line
    path.write_text(HEAD.format(up=up, unit=unit, end=end) + body.replace("}", "\n}"))
    return path


def mesh(inside: str = "", shape: str = QUAD, name: str = "quad") -> str:
    return f'def Mesh "{name}" {{{shape}{inside}}}\n'


def material(inputs: str, nodes: str = "", name: str = "Mat") -> str:
    """A material of a UsdPreviewSurface with these inputs, and further shaders."""
    return f"""def Material "{name}" {{
        token outputs:surface.connect = </{name}/S.outputs:surface>
        def Shader "S" {{
            uniform token info:id = "UsdPreviewSurface"
            {inputs}
            token outputs:surface
        }}
        {nodes}
    }}
"""


def texture(name: str, file: str, more: str = "", output: str = "float3 outputs:rgb", st: str = "R") -> str:
    """A shader that reads a picture; its coordinates come from the shader ``st``."""
    return f"""def Shader "{name}" {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{file}@
            token inputs:wrapS = "repeat"
            token inputs:wrapT = "repeat"
            float2 inputs:st.connect = </Mat/{st}.outputs:result>
            {more}
            {output}
        }}
"""


READER = """def Shader "R" {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }
"""
