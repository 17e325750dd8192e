"""What a module of kernels needs to call the C++ in the rooms' ``native/``, which Warp's compiler builds with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import warp as wp

_NATIVE = sorted(path for path in Path(__file__).resolve().parents[1].glob("*/native"))
_QUIET = '#pragma clang diagnostic ignored "-Wpsabi"\n'
"""Where registers are narrower than sixteen floats Clang warns, at every function that takes or returns a vector, that
code compiled for wider ones would call it differently. All of a module is compiled at once, for one processor."""


def module_options(*headers: str) -> dict[str, Any]:
    """Options of a Warp module whose kernels call functions of these headers."""
    build = wp.ModuleBuildOptions(
        extra_cpu_include_dirs=[str(folder) for folder in _NATIVE],
        extra_cpu_preamble=_QUIET + "".join(f'#include "{header}"\n' for header in headers),
        extra_build_dependencies=[str(header) for folder in _NATIVE for header in sorted(folder.glob("*.h"))],
    )
    return {"enable_backward": False, "extra_build_options": build}
