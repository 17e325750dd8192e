"""Colours from scene files, given as XYZ, sampled spectra, black bodies or names of metals."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenes.arithmetic import exp, expm1, power, product
from scenes.canonical.values import Rgb

XYZ_TO_RGB = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)
"""Matrix from CIE XYZ to linear Rec. 709 with the white point D65 (IEC 61966-2-1)."""

_Y_INTEGRAL = 106.856895  # integral of the colour matching function for luminance, CIE 1931

METALS: dict[str, tuple[Rgb, Rgb]] = {
    "Ag": ((0.15528, 0.11673, 0.13839), (4.82835, 3.12222, 2.14690)),
    "Al": ((1.65750, 0.88041, 0.52124), (9.22381, 6.26950, 4.83700)),
    "Au": ((0.14304, 0.37531, 1.44205), (3.98300, 2.38556, 1.60336)),
    "Cr": ((4.36967, 2.91651, 1.65491), (5.20655, 4.23131, 3.75470)),
    "Cu": ((0.20101, 0.92375, 1.10222), (3.91326, 2.45305, 2.14209)),
    "Hg": ((2.39894, 1.44003, 0.90957), (6.32759, 4.37193, 3.42176)),
    "Ir": ((3.08630, 2.08219, 1.61792), (5.59215, 4.06709, 3.26731)),
    "Li": ((0.26579, 0.19562, 0.22095), (3.54016, 2.31112, 1.66861)),
    "W": ((4.37082, 3.30025, 2.99841), (3.50064, 2.60487, 2.27323)),
}
"""Complex refractive index in RGB, ``(eta, k)``, as computed by Mitsuba 3.9.1 from its measured spectra."""

_LONG_NAMES = {"silver": "Ag", "aluminium": "Al", "aluminum": "Al", "gold": "Au", "copper": "Cu"}


def metal(name: str) -> tuple[Rgb, Rgb] | None:
    """Refractive index of a metal by its symbol or name, or None if it is unknown."""
    return METALS.get(name) or METALS.get(_LONG_NAMES.get(name.lower(), ""))


def rgb(values: ArrayLike) -> Rgb:
    """A colour from any three numbers."""
    red, green, blue = (float(value) for value in np.asarray(values, np.float64).reshape(3))
    return red, green, blue


def grey(value: float) -> Rgb:
    """A colour of three equal channels."""
    return (value, value, value)


def xyz_to_rgb(xyz: ArrayLike) -> Rgb:
    """Linear Rec. 709 of a CIE XYZ colour; negative channels become 0."""
    return rgb(np.maximum(product(XYZ_TO_RGB, np.asarray(xyz, np.float64)), 0.0))


def _lobe(x: NDArray[np.float64], peak: float, left: float, right: float) -> NDArray[np.float64]:
    return exp(-0.5 * ((x - peak) * np.where(x < peak, left, right)) ** 2)


def matching(wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64]:
    """CIE 1931 colour matching functions ``(n, 3)``, within about 1 % of the tables.

    Source: Wyman, Sloan and Shirley 2013, "Simple analytic approximations to the CIE XYZ color matching functions",
    listing 1.
    """
    w = wavelength_nm
    x = 1.056 * _lobe(w, 599.8, 1 / 37.9, 1 / 31.0) + 0.362 * _lobe(w, 442.0, 1 / 16.0, 1 / 26.7)
    x -= 0.065 * _lobe(w, 501.1, 1 / 20.4, 1 / 26.2)
    y = 0.821 * _lobe(w, 568.8, 1 / 46.9, 1 / 40.5) + 0.286 * _lobe(w, 530.9, 1 / 16.3, 1 / 31.1)
    z = 1.217 * _lobe(w, 437.0, 1 / 11.8, 1 / 36.0) + 0.681 * _lobe(w, 459.0, 1 / 26.0, 1 / 13.8)
    return np.stack([x, y, z], axis=1)


def sampled_rgb(wavelength_nm: NDArray[np.float64], values: NDArray[np.float64]) -> Rgb:
    """Colour of a sampled spectrum, linear between its samples and constant beyond; a constant 1 has luminance 1.

    Args:
        wavelength_nm: ``(n,)`` in any order.
        values: ``(n,)`` values of the spectrum.
    """
    order = np.argsort(wavelength_nm)
    at = np.arange(360.0, 831.0)
    spectrum = np.interp(at, wavelength_nm[order], values[order])
    return xyz_to_rgb((spectrum[:, None] * matching(at)).sum(axis=0) / _Y_INTEGRAL)


def planck(wavelength_nm: NDArray[np.float64], kelvin: float) -> NDArray[np.float64]:
    """Radiance of a black body, W m⁻² sr⁻¹ nm⁻¹.

    Source: Planck's law, ``2 h c² / λ⁵ / (exp(h c / λ k T) - 1)``, with the constants of CODATA 2018.
    """
    second = 1.438776877e7  # hc / k, nm K
    return 1.191042972e20 * power(wavelength_nm, -5.0) / expm1(np.minimum(second / (wavelength_nm * kelvin), 700.0))


def radiant_rgb(kelvin: float, scale: float) -> Rgb:
    """Colour of a black body with its absolute radiance, W m⁻² sr⁻¹ nm⁻¹, times ``scale`` (as in Mitsuba)."""
    at = np.arange(360.0, 831.0)
    return sampled_rgb(at, scale * planck(at, kelvin))


def blackbody_rgb(kelvin: float, scale: float) -> Rgb:
    """Colour of a black body whose spectrum is scaled to the maximum ``scale`` (as in PBRT v3).

    Source: Planck's law; Wien's displacement law for the peak.
    """
    at = np.arange(360.0, 831.0)
    peak = planck(np.array([2.897771955e6 / kelvin]), kelvin)[0]
    return sampled_rgb(at, scale * planck(at, kelvin) / peak)
