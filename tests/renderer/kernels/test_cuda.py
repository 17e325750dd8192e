"""The kernels for GPUs compile; running them needs a GPU."""

from __future__ import annotations

import re
from pathlib import Path

import warp as wp

from renderer.kernels import entry as kernels
from renderer.layout.features import ALL


def test_kernels_of_single_samples_compile_for_cuda(tmp_path: Path) -> None:
    for module in (kernels, kernels.specialised(ALL).module):
        wp.compile_aot_module(module, arch=80, module_dir=str(tmp_path), use_ptx=True)
    code = "".join(path.read_text() for path in tmp_path.glob("*.ptx"))
    for name in ("shade_samples", "render_pixels", "pose_tracks"):
        assert re.search(rf"\.entry \w*{name}", code), name
