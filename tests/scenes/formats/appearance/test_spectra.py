"""Colours of spectra, black bodies and metals."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.formats.appearance.spectra import METALS, blackbody_rgb, sampled_rgb


def test_metals_are_those_of_mitsuba() -> None:
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    for name, (eta, k) in METALS.items():
        found = mi.traverse(mi.load_dict({"type": "conductor", "material": name}))
        np.testing.assert_allclose(eta, list(found["eta.value"]), atol=2e-5)
        np.testing.assert_allclose(k, list(found["k.value"]), atol=2e-5)


def test_colours_of_spectra() -> None:
    flat = np.array(sampled_rgb(np.array([400.0, 700.0]), np.array([1.0, 1.0])))
    assert flat @ [0.2126, 0.7152, 0.0722] == pytest.approx(1.0, abs=0.01)
    red, _, blue = blackbody_rgb(2000.0, 1.0)
    assert red > 5.0 * blue
    warm = np.array(blackbody_rgb(6504.0, 1.0))
    assert warm.max() / warm.min() < 1.1  # next to white D65
