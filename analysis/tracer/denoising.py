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

Picture = Callable[[int, float], Tensor]


def denoised(picture: Picture, renderer: Renderer, size_px: tuple[int, int], crop: Crop | None = None) -> Picture:
    """The pictures without noise; negative and non-finite values are 0 before they are filtered.

    Args:
        picture: function of a still's number and time that gives its linear radiance ``(h, w, 3)``.
        renderer: renderer of the scene, for albedo and normals.
        size_px: width and height of the whole picture.
        crop: part of the picture that is rendered.
    """
    from pyoidn import denoise  # type: ignore[import-not-found]

    def made(number: int, time_s: float) -> Tensor:
        noisy = torch.nan_to_num(picture(number, time_s), 0.0, 0.0, 0.0).clamp(min=0.0).cpu().numpy()
        found = render_guides(renderer, *size_px, time_s)
        guides = (cut(torch.from_numpy(part), crop).numpy() for part in (found.albedo, found.normal))
        albedo, normal = (np.ascontiguousarray(part, np.float32) for part in guides)
        clear = denoise(np.ascontiguousarray(noisy, np.float32), np.clip(albedo, 0.0, 1.0), normal, hdr=True)
        return torch.from_numpy(clear)

    return made
