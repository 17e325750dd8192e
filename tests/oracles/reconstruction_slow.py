"""Reconstruction one pixel and one framelet at a time, from the definition (sec. 4.2): the slow, obvious version."""

import torch

from tsar.morton import deinterleave, raster_to_morton


def slow_reconstruct(framelets, resolution, side, support_px, cycle_s, pixels):
    """Colours of the given ``(x, y)`` pixels.

    ``framelets``: list of ``(level, index, time_s, color (samples, 3))``; every pixel of the image must be covered.
    """
    newest = torch.full((resolution, resolution), -torch.inf, dtype=torch.float64)
    for level, index, time_s, _ in framelets:
        x, y = (int(v) for v in deinterleave(torch.tensor(index)))
        w = resolution >> level
        block = newest[y * w : (y + 1) * w, x * w : (x + 1) * w]
        block[:] = torch.maximum(block, torch.tensor(time_s, dtype=torch.float64))
    age = (newest - newest.max()) / cycle_s
    half = support_px // 2
    colors = []
    for px, py in pixels:
        rows = [min(max(py + d, 0), resolution - 1) for d in range(-half, half + 1)]
        columns = [min(max(px + d, 0), resolution - 1) for d in range(-half, half + 1)]
        threshold = min(float(age[py, px]), float(age[rows][:, columns].mean()))
        total, weight = torch.zeros(3, dtype=torch.float64), 0.0
        for level, index, time_s, color in framelets:
            newer = (time_s - float(newest.max())) / cycle_s - threshold
            if newer < -1e-9:
                continue
            x, y = (int(v) for v in deinterleave(torch.tensor(index)))
            w = resolution >> level
            spacing = w / side
            wx = _weights(px + 0.5 - x * w, side, spacing)
            wy = _weights(py + 0.5 - y * w, side, spacing)
            raster = color[raster_to_morton(side)].reshape(side, side, 3).to(torch.float64)
            spatial = wy[:, None] * wx[None, :]
            total += (newer + 0.5) * (spatial[..., None] * raster).sum((0, 1))
            weight += (newer + 0.5) * float(spatial.sum())
        colors.append(total / weight)
    return torch.stack(colors)


def _weights(at, side, spacing):
    sample = (torch.arange(side, dtype=torch.float64) + 0.5) * spacing
    distance = (at - sample).abs()
    if spacing >= 1.0:
        return (1.0 - distance / spacing).clamp(min=0.0)
    return (distance < 0.5).to(torch.float64) * spacing
