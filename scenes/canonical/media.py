"""Participating media of the canonical scene; conventions as in :mod:`scenes.canonical`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenes.canonical.values import Rgb, SceneError


@dataclass(frozen=True)
class Medium:
    """A homogeneous medium that absorbs and scatters light, with the phase function of Henyey and Greenstein.

    The renderer does not support media; they are kept for conversion.

    Attributes:
        absorption: coefficient σa, share of the light that is absorbed per scene unit, linear RGB, non-negative.
        scattering: coefficient σs, share that is scattered per scene unit, linear RGB, non-negative.
        g: mean cosine of the angle of scattering, in (-1, 1), positive for scattering forwards; 0 is isotropic.

    Source: Henyey and Greenstein 1941; Pharr, Jakob and Humphreys 2023, ch. 11.
    """

    absorption: Rgb = (0.0, 0.0, 0.0)
    scattering: Rgb = (0.0, 0.0, 0.0)
    g: float = 0.0

    def __post_init__(self) -> None:
        for name in ("absorption", "scattering"):
            values = np.array(getattr(self, name))
            if not (np.isfinite(values).all() and values.min() >= 0.0):
                raise SceneError(f"Medium.{name}: expected finite numbers of at least 0, got {getattr(self, name)}")
        if not -1.0 < self.g < 1.0:
            raise SceneError(f"Medium.g: expected a number in (-1, 1), got {self.g:g}")

    @property
    def extinction(self) -> Rgb:
        """The sum of both coefficients, σt."""
        red, green, blue = (a + s for a, s in zip(self.absorption, self.scattering, strict=True))
        return red, green, blue

    @property
    def scatters(self) -> bool:
        """Whether it scatters light of any colour."""
        return max(self.scattering) > 0.0
