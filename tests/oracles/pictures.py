"""Analytic pictures that stand in for the renderer: functions of position and time, evaluated exactly."""

import torch

from tsar.types import FrameletBatch, SampleBatch


def tracer(picture):
    """A ``trace`` callable from ``picture(x, y, t) -> (…, 3)``."""

    def trace(batch: FrameletBatch) -> SampleBatch:
        x, y = batch.position.unbind(-1)
        times = batch.times.to(torch.float32).contiguous()
        color = picture(x, y, times).to(torch.float32)
        return SampleBatch(color, {"primary_rays": int(x.numel())})

    return trace


def constant(x, y, t):
    return torch.full((*x.shape, 3), 0.4)


def static_stripes(x, y, t):
    """Fine stripes on the left half, flat grey on the right; nothing moves."""
    value = torch.where(x < 0.5, 0.5 + 0.4 * torch.sign(torch.sin(200.0 * x + 70.0 * y)), 0.3)
    return value[..., None].expand(*x.shape, 3)


def moving_edge(speed=0.25, start=0.1):
    """A vertical edge that moves to the right at ``speed`` image widths a second."""

    def picture(x, y, t):
        value = torch.where(x < start + speed * t, 0.9, 0.1)
        return value[..., None].expand(*x.shape, 3)

    return picture


def textured_motion(x, y, t):
    """A smoothly textured picture that pans, with a moving bright disk."""
    base = 0.4 + 0.2 * torch.sin(40.0 * (x + 0.3 * t)) * torch.sin(30.0 * y)
    disk = torch.hypot(x - 0.3 - 0.4 * t, y - 0.5) < 0.1
    value = torch.where(disk, 0.9, base)
    return torch.stack((value, value * 0.8, value * 0.6), dim=-1)
