"""Module options with which kernels can call the C++ in the ``native/`` folders; Warp's compiler builds it with
them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from renderer.compute import sizes

_NATIVE = sorted(path for path in Path(__file__).resolve().parents[1].glob("*/native"))
_QUIET = '#pragma clang diagnostic ignored "-Wpsabi"\n'
"""Where registers are narrower than sixteen floats, Clang warns at every function that takes or returns a vector that
its calling convention differs from that of code for wider registers. That does not apply: a module is compiled as a
whole, for one processor."""


def module_options(*headers: str, given: Mapping[str, float] | None = None) -> dict[str, Any]:
    """Options of a Warp module whose kernels call functions of these headers.

    Args:
        headers: names of files in a room's ``native/``.
        given: constants in the namespace ``given`` of the headers, in addition to those of
            :mod:`renderer.compute.sizes`.
    """
    constants = declarations({**sizes.GIVEN, **(given or {})})
    build = wp.ModuleBuildOptions(
        extra_cpu_include_dirs=[str(folder) for folder in _NATIVE],
        extra_cpu_preamble=_QUIET + constants + "".join(f'#include "{header}"\n' for header in headers),
        extra_build_dependencies=[str(header) for folder in _NATIVE for header in sorted(folder.glob("*.h"))],
    )
    return {"enable_backward": False, "extra_build_options": build}


def declarations(given: Mapping[str, float]) -> str:
    """C++ declarations of constants: integers as ``int``, ``numpy.float64`` as ``double``, others as ``float``."""
    return "namespace given {\n" + "".join(_declared(name, value) for name, value in given.items()) + "}\n"


def _declared(name: str, value: float) -> str:
    if isinstance(value, int):
        return f"constexpr int {name} = {value!r};\n"
    kind, suffix = ("double", "") if isinstance(value, np.float64) else ("float", "f")
    return f"constexpr {kind} {name} = {float(value)!r}{suffix};\n"
