"""What is made of a shape is kept as long as the shape, and no longer."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from scenes.canonical import Curves, Mesh
from scenes.formats.geometry.curves import curve_mesh
from scenes.formats.geometry.orientation import is_closed, turned, upright

LINE = np.array([[0.0, 0, 0], [1, 0, 0]], np.float32)


def mesh() -> Mesh:
    return Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))


@pytest.mark.parametrize(("shape", "made"), [
    (mesh, turned), (mesh, is_closed), (mesh, lambda one: upright(one, np.diag([1.0, 1.0, -1.0, 1.0]))[0]),
    (lambda: Curves(LINE, np.ones(2, np.float32), np.array([2], np.int32), basis="linear"), curve_mesh),
])  # fmt: skip
def test_a_result_is_kept_with_its_shape(shape: Callable[[], Any], made: Callable[[Any], Any]) -> None:
    given = shape()
    assert made(given) is made(given)
    left = weakref.ref(given)
    del given
    gc.collect()
    assert left() is None
