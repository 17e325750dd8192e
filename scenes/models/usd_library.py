"""Modules of the package usd-core (extra ``usd``), which has no types."""

from __future__ import annotations

from importlib import import_module
from typing import Any

_NAMES = ("Ar", "Gf", "Sdf", "Tf", "Usd", "UsdGeom", "UsdLux", "UsdShade", "UsdSkel", "UsdUtils")

Ar: Any
Gf: Any
Sdf: Any
Tf: Any
Usd: Any
UsdGeom: Any
UsdLux: Any
UsdShade: Any
UsdSkel: Any
UsdUtils: Any
Ar, Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel, UsdUtils = (import_module(f"pxr.{name}") for name in _NAMES)
