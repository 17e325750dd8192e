"""Elements of a field with errors: made at random, or at the extremes."""

import torch

from tsar.response.local import Box, constrain
from tsar.types import Errors

BOX = Box(spatial_min=1 / 256, temporal_min=1 / 64)


def random_problem(seed, count=256, quiet=0.3):
    g = torch.Generator().manual_seed(seed)

    def uniform(low, high):
        return low + (high - low) * torch.rand(count, generator=g, dtype=torch.float64)

    errors = torch.stack((uniform(-1, 1), uniform(-1, 1)))
    errors[:, torch.rand(count, generator=g) < quiet] = 0.0
    errors[0, :20] = 0.0  # axis-aligned
    errors[1, 20:40] = 0.0
    a_s, a_t = uniform(BOX.spatial_min, 1), uniform(BOX.temporal_min, 1)
    a_s[40:50], a_t[50:60] = BOX.spatial_min, 1.0  # at a wall
    return constrain(a_s, a_t, Errors(errors[0], errors[1]), BOX, 1.0)


def extreme_problem(seed, count=256):
    """Errors and densities over many decades, nearly axis-aligned directions, elements at and close to every wall."""
    g = torch.Generator().manual_seed(seed)

    def decades(low):
        return 10.0 ** (low * torch.rand(count, generator=g, dtype=torch.float64))

    errors = torch.stack((decades(-15), decades(-15))) * torch.sign(torch.randn(2, count, generator=g))
    a_s, a_t = decades(-2.4).clamp(min=BOX.spatial_min), decades(-1.8).clamp(min=BOX.temporal_min)
    a_s[:16], a_s[16:32] = BOX.spatial_min, 1.0
    a_t[8:24], a_t[24:40] = BOX.temporal_min, 1.0
    a_s[40:48], a_t[48:56] = BOX.spatial_min * (1 + 1e-8), 1 - 1e-8
    return constrain(a_s, a_t, Errors(errors[0], errors[1]), BOX, 1.0)
