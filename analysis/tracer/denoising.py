"""Denoising of stills by Open Image Denoise, guided by albedo and normals.

Source: Intel, "Open Image Denoise", filter ``RT``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from renderer.frames import Crop, cut
from renderer.guides import render_guides
from renderer.trace import Renderer

StillOf = Callable[[int, float], Tensor]
"""Makes the still of a number and a time in seconds: linear radiance ``(h, w, 3)``."""


def denoised(
    still_of: StillOf, renderer_at: Callable[[float], Renderer], size_px: tuple[int, int], crop: Crop | None = None
) -> StillOf:
    """The stills without noise. Negative and non-finite values are 0 for the filter; the latter stay in the result, so
    that they are counted.

    Args:
        still_of: makes the stills.
        renderer_at: renderer of the scene at a time in seconds, for albedo and normals.
        size_px: width and height of the whole picture.
        crop: part of the picture that is rendered.
    """
    from pyoidn import denoise  # type: ignore[import-not-found]

    def made(number: int, time_s: float) -> Tensor:
        still = still_of(number, time_s).cpu()
        noisy = torch.nan_to_num(still, 0.0, 0.0, 0.0).clamp(min=0.0).numpy()
        found = render_guides(renderer_at(time_s), *size_px, time_s)
        guides = (cut(torch.from_numpy(part), crop).numpy() for part in (found.albedo, found.normal))
        albedo, normal = (np.ascontiguousarray(part, np.float32) for part in guides)
        clear = denoise(np.ascontiguousarray(noisy, np.float32), np.clip(albedo, 0.0, 1.0), normal, hdr=True)
        return torch.where(still.isfinite(), torch.from_numpy(clear), still)

    return made
