"""Batches for the kernels that trace single samples."""

from __future__ import annotations

import numpy as np
import torch
import warp as wp
from torch import Tensor

from renderer.batches import empty_hits
from tsar.types import FrameletBatch


class SingleSamples:
    """A batch as the arguments of :func:`renderer.kernels.entry.specialised`'s ``shade_samples``, and its answer.

    Attributes:
        arguments: arguments after that for the first sample of a launch.
        color, hits: ``(n, s, 3)`` radiance and first hits, filled by the launches; hits are None unless requested.
    """

    def __init__(self, batch: FrameletBatch, device: torch.device) -> None:
        """Copies a batch from :func:`renderer.batches.checked` to the device."""
        groups, group_size, _ = batch.position.shape
        count, time_s, scale = groups * group_size, batch.time_s, batch.footprint
        self.color = torch.empty(groups, group_size, 3, device=device)
        self.hits = empty_hits(groups, group_size, device) if batch.hits else None
        self._rays = torch.empty(count, 3, dtype=torch.int32, device=device)
        if not isinstance(time_s, Tensor):
            time_s = torch.full((count,), time_s, dtype=torch.float64)
        place, times = batch.position.to(device, torch.float32), time_s.to(device, torch.float64)
        scales, point = (wp.empty(0, kind, str(device)) for kind in (wp.float32, wp.vec3))
        instance, occluder = (wp.empty(0, wp.int32, str(device)) for _ in range(2))
        if scale is not None:
            scales = wp.from_torch(scale.to(device, torch.float32).reshape(-1).contiguous(), dtype=wp.float32)
        if self.hits is not None:
            instance = wp.from_torch(self.hits.instance.view(-1), dtype=wp.int32)
            point = wp.from_torch(self.hits.point.view(-1, 3), dtype=wp.vec3)
            occluder = wp.from_torch(self.hits.occluder.view(-1), dtype=wp.int32)
        self.arguments = (
            group_size,
            wp.from_torch(place.reshape(-1, 2).contiguous(), dtype=wp.vec2),
            wp.from_torch(times.reshape(-1).contiguous(), dtype=wp.float64),
            scales,
            wp.from_torch(self.color.view(-1, 3), dtype=wp.vec3),
            instance,
            point,
            occluder,
            wp.from_torch(self._rays, dtype=wp.vec3i),
        )

    def totals(self) -> list[int]:
        """Numbers of shadow, reflected and refracted rays of all samples."""
        if self._rays.is_cpu:  # by NumPy, as in renderer.batches.bounds
            return self._rays.numpy().sum(axis=0, dtype=np.int64).tolist()
        return self._rays.sum(dim=0, dtype=torch.int64).tolist()
