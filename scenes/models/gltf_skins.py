"""Skins of a glTF file: meshes bent by the joints of a skeleton.

Source: Khronos Group, "glTF 2.0 specification", section 3.7.3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float64
from numpy.typing import NDArray

from scenes.arithmetic import product
from scenes.canonical import Matrix
from scenes.models.gltf_data import GltfData
from scenes.models.json_records import misplaced

Bends = Float64[NDArray, "vertices 4 4"]


def joint_matrices(data: GltfData, number: int, world: dict[int, Matrix]) -> Float64[NDArray, "joints 4 4"]:
    """Transforms from the bind pose to the world, of the joints of a skin.

    Args:
        data: file.
        number: index of the skin.
        world: transforms from the nodes to the world.

    Raises:
        SceneError: the skin refers to a node outside of the scene, or has another number of inverse bind matrices.
    """
    skin = data.at("skins", number)
    joints = skin["joints"]
    missing = [joint for joint in joints if joint not in world]
    if missing or not joints:
        got = f"node {missing[0]} outside of it" if missing else "none"
        raise misplaced(f"skins[{number}].joints", "nodes of the scene", got)
    if "inverseBindMatrices" not in skin:
        return np.stack([world[joint] for joint in joints])
    rest = data.numbers(skin["inverseBindMatrices"], "inverseBindMatrices", ("MAT4",))
    if len(rest) != len(joints):
        raise misplaced(f"skins[{number}].inverseBindMatrices", f"{len(joints)} matrices", len(rest))
    return product(np.stack([world[joint] for joint in joints]), np.swapaxes(rest.reshape(-1, 4, 4), 1, 2))


def bends(
    data: GltfData, attributes: dict[str, Any], matrices: Float64[NDArray, "joints 4 4"], count: int, place: str
) -> Bends:
    """The transform of each vertex: the mean of those of its joints by their weights, which are normalised.

    Raises:
        SceneError: joints or weights are missing, or out of range.
    """
    total, sums = np.zeros((count, 4, 4)), np.zeros(count)
    sets = [index for index in range(4) if f"JOINTS_{index}" in attributes and f"WEIGHTS_{index}" in attributes]
    for index in sets:
        joints = data.indices(attributes[f"JOINTS_{index}"], f"JOINTS_{index}")
        weights = data.numbers(attributes[f"WEIGHTS_{index}"], f"WEIGHTS_{index}", ("VEC4",))
        for name, found in ((f"JOINTS_{index}", joints), (f"WEIGHTS_{index}", weights)):
            if len(found) != count:
                raise misplaced(f"{place}.attributes.{name}", f"{count} elements", len(found))
        if count and joints.max() >= len(matrices):
            expected = f"indices of joints below {len(matrices)}"
            raise misplaced(f"{place}.attributes.JOINTS_{index}", expected, joints.max())
        for lane in range(4):
            total += weights[:, lane, None, None] * matrices[joints[:, lane]]
        sums += weights.sum(axis=1)
    if not sets or not (sums > 0.0).all():
        raise misplaced(f"{place}.attributes", "a joint with a weight for each vertex", "a vertex without")
    return total / sums[:, None, None]


def bent(
    bend: Bends, points: NDArray[np.float64], normals: NDArray[np.float64] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Points and normals in the world."""
    moved = product(bend[:, :3, :3], points[..., None])[..., 0] + bend[:, :3, 3]
    if normals is None:
        return moved, None
    rows = np.swapaxes(bend[:, :3, :3], 1, 2)
    # the cofactors are the inverse transpose times the determinant, and exist for singular transforms too
    cofactors = np.stack([np.cross(rows[:, (axis + 1) % 3], rows[:, (axis + 2) % 3]) for axis in range(3)], axis=-1)
    sign = np.where(np.linalg.det(bend[:, :3, :3]) < 0.0, -1.0, 1.0)
    return moved, sign[:, None] * product(cofactors, normals[..., None])[..., 0]
