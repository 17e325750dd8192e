"""Models written by tests."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np

CASES = Path(__file__).parent / "cases"
QUAD = ((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0))
QUAD_UVS = ((0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0))
_WIDTHS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}


class Gltf:
    """A file of one mesh, a quad unless other positions are given."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "in.gltf"
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"}, "buffers": [], "bufferViews": [], "accessors": [],
            "meshes": [{"primitives": [{"attributes": {}}]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}],
        }  # fmt: skip
        self.attribute("POSITION", np.array(QUAD, np.float32))
        self.primitive["indices"] = self.accessor(np.array([0, 1, 2, 0, 2, 3], np.uint16))

    @property
    def primitive(self) -> dict[str, Any]:
        return self.json["meshes"][0]["primitives"][0]

    def accessor(self, values: np.ndarray, normalized: bool = False) -> int:
        """The number of a new accessor of these rows."""
        values = values.reshape(len(values), -1)
        content = base64.b64encode(values.tobytes()).decode()
        self.json["buffers"].append(
            {"byteLength": values.nbytes, "uri": f"data:application/octet-stream;base64,{content}"}
        )
        number = len(self.json["buffers"]) - 1
        self.json["bufferViews"].append({"buffer": number, "byteLength": values.nbytes})
        self.json["accessors"].append(
            {"bufferView": number, "componentType": _TYPES[values.dtype.str[1:]], "count": len(values),
             "type": _WIDTHS[values.shape[1]], "normalized": normalized}
        )  # fmt: skip
        return len(self.json["accessors"]) - 1

    def attribute(self, name: str, values: np.ndarray, normalized: bool = False) -> None:
        self.primitive["attributes"][name] = self.accessor(values, normalized)

    def material(self, **values: Any) -> None:
        self.json["materials"] = [values]
        self.primitive["material"] = 0

    def texture(self, file: str, sampler: dict[str, int] | None = None) -> int:
        """The number of a new texture of a file."""
        self.json.setdefault("images", []).append({"uri": file})
        texture = {"source": len(self.json["images"]) - 1}
        if sampler is not None:
            self.json.setdefault("samplers", []).append(sampler)
            texture["sampler"] = len(self.json["samplers"]) - 1
        self.json.setdefault("textures", []).append(texture)
        return len(self.json["textures"]) - 1

    def written(self) -> Path:
        self.path.write_text(json.dumps(self.json))
        return self.path
