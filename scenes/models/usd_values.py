"""Values of attributes of USD prims."""

from __future__ import annotations

from typing import Any

import numpy as np

from scenes.canonical import SceneError


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
        raise SceneError(f"cannot be read: {where}: expected finite numbers, got {value}")
    return value
