"""Light that passes the rough coats of Mitsuba's plastic."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from scenes.formats.appearance.coats import _ALPHAS, _PASSED, _REFLECTANCES

EYE_RAD = math.radians(37.0)


@pytest.mark.parametrize(("row", "column"), list(product(range(1, 5), range(1, 6))))
def test_what_a_white_base_reflects_is_what_mitsuba_gives(row: int, column: int) -> None:
    """The mean of ``eval`` of the diffuse component over 24 x 32 directions of a hemisphere."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    root = math.sqrt(_REFLECTANCES[row])
    given = {"type": "rgb", "value": [1.0, 1.0, 1.0]}
    plastic = mi.load_dict({
        "type": "roughplastic", "alpha": _ALPHAS[column], "int_ior": (1.0 + root) / (1.0 - root), "ext_ior": 1.0,
        "diffuse_reflectance": given,
    })  # fmt: skip
    seen, context = mi.SurfaceInteraction3f(), mi.BSDFContext()
    seen.wi, context.component = mi.Vector3f(math.sin(EYE_RAD), 0.0, math.cos(EYE_RAD)), 1
    found = []
    for up, turn in product((np.arange(24) + 0.5) / 24.0, (np.arange(32) + 0.5) / 32.0 * 2.0 * math.pi):
        flat = math.sqrt(1.0 - up * up)
        found.append(plastic.eval(context, seen, mi.Vector3f(flat * math.cos(turn), flat * math.sin(turn), up))[0])
    assert 2.0 * math.pi * np.mean(found) == pytest.approx(_PASSED[row, column], abs=0.01)
