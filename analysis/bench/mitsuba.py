"""Mitsuba 3 as a peer: its variants in one process, and pictures of a scene by one of them.

Its LLVM variant looks for a shared library of LLVM when it is imported. The environment variable that it reads names
the newest version that is known to work, unless the user has set it.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from analysis.bench.machine import installed
from analysis.bench.mitsuba_scene import translate
from analysis.bench.rows import NOT_INSTALLED
from scenes.canonical import Scene

VARIANTS = {"llvm_ad_rgb": 1.2, "scalar_rgb": 3.0}
"""Variants on the CPU, both on all cores, and the least ratio to reach."""

_LLVM_VARIABLE = "DRJIT_LIBLLVM_PATH"
_LLVM_NAMES = ("libLLVM.so.19*", "libLLVM-19.so*")  # libllvm14 and 15 load but fail
_LLVM_FOLDERS = ("/usr/lib/*-linux-gnu", "/usr/lib64", "/usr/lib", "/usr/lib/llvm-19/lib", "/usr/local/lib")

IntegratorName = Literal["direct", "path"]


def find_llvm() -> str | None:
    """Path of an LLVM library for the LLVM variant, or None."""
    if os.environ.get(_LLVM_VARIABLE):
        return os.environ[_LLVM_VARIABLE]
    root = Path("/")
    for folder in _LLVM_FOLDERS:
        for name in _LLVM_NAMES:
            found = sorted(root.glob(f"{folder.lstrip('/')}/{name}"))
            if found:
                return str(found[0])
    return None


def missing(variant: str) -> str:
    """Why a variant cannot run here; empty where it can."""
    if not installed("mitsuba"):
        return NOT_INSTALLED
    if variant.startswith("llvm") and find_llvm() is None:
        return "no library of LLVM 19 (Debian's package libllvm19)"
    return ""


def select(variant: str) -> Any:
    """Mitsuba's module with one variant selected."""
    library = find_llvm()
    if library is not None:
        os.environ.setdefault(_LLVM_VARIABLE, library)
    import mitsuba

    if mitsuba.variant() != variant:
        mitsuba.set_variant(variant)
    return mitsuba


@dataclass(frozen=True)
class MitsubaPicture:
    """A still of a scene, rendered by one variant of Mitsuba.

    Attributes:
        variant: see :data:`VARIANTS`.
        scene: Mitsuba's scene object, of that variant.
    """

    variant: str
    scene: Any

    def render(self, samples_per_pixel: int, seed: int = 0) -> NDArray[np.float32]:
        """``(height, width, 3)`` linear RGB; an array on the host, so that all work is done when it is returned.

        Bypasses ``mitsuba.render``, which needs the variant to be selected: selecting one takes about 50 ms.
        """
        return np.array(self.scene.integrator().render(self.scene, seed=seed, spp=samples_per_pixel))

    def repeated(self, samples_per_pixel: int) -> Callable[[], object]:
        """A function that renders with another seed at each call."""
        seeds = iter(range(2**31))
        return lambda: self.render(samples_per_pixel, next(seeds))


def still(scene: Scene, time_s: float, resolution_px: int, integrator: IntegratorName, variant: str) -> MitsubaPicture:
    """Mitsuba's version of a scene at one time.

    Args:
        scene: ours.
        time_s: animation time, seconds; moving objects stand still in their pose at that time.
        resolution_px: side of the picture, pixels.
        integrator: ``direct`` takes one light sample per camera ray and nothing else; ``path`` has the depth of our
            mirrors, and one more vertex for light.
        variant: see :data:`VARIANTS`.
    """
    mitsuba = select(variant)
    options: dict[str, Any] = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0}
    if integrator == "path":
        # edges of the longest path: to the first surface, one for each mirror, to the light
        options = {"type": "path", "max_depth": scene.integrator.depth + 2}
    film = {
        "type": "hdrfilm",
        "width": resolution_px,
        "height": resolution_px,
        "rfilter": {"type": "box"},
        "pixel_format": "rgb",
        "component_format": "float32",
    }
    described = translate(mitsuba, scene, time_s)
    described["sensor"] |= {"film": film, "sampler": {"type": "independent"}}
    return MitsubaPicture(variant, mitsuba.load_dict({"type": "scene", "integrator": options, **described}))
