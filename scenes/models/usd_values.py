"""Values of attributes of USD prims."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import SceneError
from scenes.models.motion import Pose


def finite(value: Any, where: object) -> Any:
    """The value itself.

    Args:
        value: of an attribute, or None.
        where: place for the message.

    Raises:
        SceneError: it has numbers that are not finite.
    """
    numbers = np.asarray(value)
    if numbers.dtype.kind == "f" and not np.isfinite(numbers).all():
        got = value if numbers.ndim < 2 else numbers[~np.isfinite(numbers).all(axis=-1)][0].tolist()  # the first row
        raise SceneError(f"cannot be read: {where}: expected finite numbers, got {got}")
    return value


def array_of(values: Any, width: int) -> NDArray[np.float64]:
    """Values of an attribute ``(n, width)``, or ``(n,)`` for a width of 0; empty without a value."""
    if values is None:
        return np.zeros((0, width) if width else 0)
    found = np.array(values, np.float64)
    return found.reshape(-1, width) if width else found.reshape(-1)


def note_animated(prim: Any, pose: Pose) -> None:
    """Notes values of a prim that change over time, beside its transform and visibility, which are read otherwise, and
    its box, which is not read."""
    names = (one.GetName() for one in prim.GetAttributes() if one.ValueMightBeTimeVarying())
    changing = sorted(name for name in names if not name.startswith("xformOp") and name not in ("visibility", "extent"))
    if changing:
        pose.add(prim.GetName(), f"values that change ({', '.join(changing)})", "those")
