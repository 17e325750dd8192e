"""Perceptual metrics of display-encoded images: JOD, FLIP, SSIM.

JOD and SSIM run on one thread, because the libraries do not guarantee the same bits for another number of threads.
"""

from __future__ import annotations

import logging

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from analysis.metrics import Metric
from analysis.metrics.display_model import DisplayModel
from tsar.threads import one_thread

Frames = NDArray[np.uint8]
"""``(count, height, width, 3)`` display-encoded images."""


def jod(test: Frames, reference: Frames, image_rate_hz: float, display: DisplayModel) -> float:
    """Quality of a sequence in just-objectionable differences: 10 is no visible difference, lower is worse.

    Images are repeated up to the declared rate of the display, as a display would show them.

    Source: Mantiuk et al. 2024, ColorVideoVDP (package ``cvvdp``).

    Raises:
        ConfigError: the rate of the images does not divide that of the display.
        ValueError: the shapes differ.
    """
    if test.shape != reference.shape:
        raise ValueError(f"jod: expected equal shapes, got {test.shape} and {reference.shape}")
    repeats = display.repeats(image_rate_hz)
    from analysis.metrics.torchvision_operators import declare_missing

    declare_missing()
    logging.getLogger("pycvvdp").setLevel(logging.ERROR)
    import pycvvdp

    with one_thread(), torch.no_grad():
        metric = pycvvdp.cvvdp(display_name=display.name, device=torch.device("cpu"), quiet=True)
        shown = [np.repeat(frames, repeats, axis=0) for frames in (test, reference)]
        score, _ = metric.predict(*shown, dim_order="FHWC", frames_per_second=round(display.rate_hz))
    return float(score)


def flip(test: Float[Tensor, "h w 3"], reference: Float[Tensor, "h w 3"]) -> float:
    """Mean FLIP error of two display-encoded images in [0, 1]; 0 is no visible difference.

    Source: Andersson et al. 2020, FLIP (package ``flip-evaluator``), default viewing distance.
    """
    import flip_evaluator

    _, mean, _ = flip_evaluator.evaluate(reference.numpy(), test.numpy(), "LDR", inputsRGB=True, applyMagma=False)
    return float(mean)


def ssim(test: Float[Tensor, "h w 3"], reference: Float[Tensor, "h w 3"]) -> float:
    """Mean structural similarity of two display-encoded images in [0, 1], window 11; 1 is equality.

    Source: Wang et al. 2004 (``kornia.metrics.ssim``).
    """
    from kornia.metrics import ssim as measure

    with one_thread():
        planes = [image.permute(2, 0, 1)[None] for image in (test, reference)]
        return float(measure(*planes, window_size=11).mean(dtype=torch.float64))


FLIP = Metric("lower", image=flip)
SSIM = Metric("higher", image=ssim)
JOD = Metric("higher", sequence=jod, unit="JOD")
