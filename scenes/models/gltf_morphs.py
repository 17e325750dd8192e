"""Morph targets of a glTF file: weighted displacements of the values of vertices.

Source: Khronos Group, "glTF 2.0 specification", section 3.7.2.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.models.gltf_data import GltfData
from scenes.models.json_records import misplaced

Weights = tuple[float, ...]
"""A weight for each target; empty for weights of zero."""


def weights_at_node(data: GltfData, number: int, animated: NDArray[np.float64] | None) -> Weights:
    """The weights of the morph targets of the mesh at a node: animated ones, else the node's, else the mesh's.

    Raises:
        SceneError: there is another number of them than of targets.
    """
    node = data.at("nodes", number)
    mesh, place = data.at("meshes", node["mesh"]), f"meshes[{node['mesh']}]"
    given = node.get("weights", mesh.get("weights", ())) if animated is None else animated
    weights = tuple(float(weight) for weight in given)
    for index, primitive in enumerate(mesh.get("primitives", ())):
        count = len(primitive.get("targets", ()))
        if weights and count != len(weights):
            raise misplaced(f"{place}.primitives[{index}].targets", f"{len(weights)} targets, one a weight", count)
    return weights if any(weights) else ()


def morphed(
    data: GltfData,
    targets: Sequence[dict[str, Any]],
    weights: Weights,
    attribute: str,
    values: NDArray[np.float64],
    place: str,
) -> NDArray[np.float64]:
    """Values of an attribute with the weighted displacements of the targets; colours lie in [0, 1].

    Raises:
        SceneError: a target has another number of elements, or wider ones.
    """
    found = values
    for number, weight in enumerate(weights):
        if weight == 0.0 or attribute not in targets[number]:
            continue
        types = tuple(f"VEC{width}" for width in range(2, values.shape[1] + 1))
        moved = data.numbers(targets[number][attribute], f"a target of {attribute}", types)
        if len(moved) != len(values):
            at = f"{place}.targets[{number}].{attribute}"
            raise misplaced(at, f"{len(values)} elements", len(moved))
        found = found.copy() if found is values else found
        found[:, : moved.shape[1]] += weight * moved
    return np.clip(found, 0.0, 1.0) if attribute.startswith("COLOR") and found is not values else found
