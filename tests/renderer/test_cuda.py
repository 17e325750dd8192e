"""The kernels that a GPU runs compile for one; running them takes a GPU."""

from __future__ import annotations

from pathlib import Path

import warp as wp

from renderer import kernels


def test_kernels_of_single_samples_compile_for_cuda(tmp_path: Path) -> None:
    wp.compile_aot_module(kernels, arch=80, module_dir=str(tmp_path), use_ptx=True)
    code = next(tmp_path.glob("*.ptx")).read_text()
    for name in ("shade_samples", "render_pixels", "pose_tracks"):
        assert f".entry {name}" in code, name
