"""Batches of samples: their validation, and their hand-over to packets with little overhead."""

from __future__ import annotations

import math
import threading
from dataclasses import replace

import numpy as np
import torch
import warp as wp
from torch import Tensor

from renderer.compute.launching import Command, address
from renderer.compute.team import TEAM
from renderer.kernels import entry as kernels
from renderer.kernels import packets
from renderer.layout.structs import ViewData
from renderer.tables.buffers import SceneBuffers
from tsar.types import FrameletBatch, Hits


def checked(batch: FrameletBatch) -> FrameletBatch:
    """The batch after validation. Its times become one number where all are equal.

    Raises:
        ValueError: if shapes do not match, times are not float64 or not finite, or a footprint is not finite and above
            0.
    """
    shape, time_s, footprint = tuple(batch.position.shape), batch.time_s, batch.footprint
    times = tuple(time_s.shape) if isinstance(time_s, Tensor) else shape[:2]
    if len(shape) != 3 or shape[2] != 2 or times != shape[:2]:
        raise ValueError(f"FrameletBatch: expected position (n, s, 2) and time_s (n, s), got {shape} and {times}")
    if isinstance(time_s, Tensor) and time_s.dtype != torch.float64:
        raise ValueError(f"FrameletBatch: expected time_s of float64, got {time_s.dtype}")
    if footprint is not None and tuple(footprint.shape) != shape[:2]:
        raise ValueError(f"FrameletBatch: expected footprint {shape[:2]}, got {tuple(footprint.shape)}")
    if not shape[0] * shape[1]:
        return replace(batch, time_s=0.0, footprint=None)
    if footprint is not None and not (bounds(footprint)[0] > 0.0 and bounds(footprint)[1] < math.inf):
        raise ValueError("FrameletBatch: expected footprints that are finite and above 0")
    earliest, latest = bounds(time_s) if isinstance(time_s, Tensor) else (time_s, time_s)
    if not (math.isfinite(earliest) and math.isfinite(latest)):
        raise ValueError("time_s: expected finite times")
    return replace(batch, time_s=earliest) if earliest == latest else batch


def bounds(values: Tensor) -> tuple[float, float]:
    """Least and greatest value; NaN if any value is NaN."""
    # by NumPy: after a parallel reduction the threads of torch spin for milliseconds and compete with ours
    given = values.numpy() if values.device.type == "cpu" else values
    return float(given.min()), float(given.max())


def empty_hits(groups: int, group_size: int, device: torch.device) -> Hits:
    """Empty records of hits, to be filled in."""
    instance, occluder = (torch.empty(groups, group_size, dtype=torch.int32, device=device) for _ in range(2))
    return Hits(instance, torch.empty(groups, group_size, 3, device=device), occluder)


class PacketBatches:
    """Shades lists of samples for one camera and one footprint, on the CPU. Calls from several threads are
    serialised."""

    def __init__(self, buffers: SceneBuffers, still: ViewData, moving: ViewData, threads: int) -> None:
        """Prepares the launches.

        Args:
            buffers: the scene.
            still, moving: records of the camera for samples of one time and of many times; ``still`` is changed here.
            threads: number of host threads that share a batch, including the caller's.
        """
        count = len(buffers.tracks.tracks)
        still.pose_translation = wp.empty(count, wp.vec3, "cpu")
        still.pose_rotation = wp.empty(count, wp.quat, "cpu")
        still.single_time = 1
        poses = still.pose_translation, still.pose_rotation
        self._pose = Command(kernels.pose_tracks, buffers.data, moving, *poses, size=count)
        self._still, self._moving = (Command(packets.shade_samples, buffers.data, view) for view in (still, moving))
        self._keep = buffers, still, moving  # launches refer to their arrays by address only
        self._threads, self._lock = threads, threading.Lock()
        self._taken, self._rays = np.zeros(1, np.int32), np.zeros(2, np.int64)
        self._counters = address("taken", self._taken, torch.int32, 1), address("rays", self._rays, torch.int64, 2)

    def shade(self, batch: FrameletBatch) -> tuple[Tensor, list[int], Hits | None]:
        """Colours ``(n, s, 3)`` float32, the numbers of rays traced, and hits if requested.

        Args:
            batch: from :func:`checked`, with all tensors on the CPU.
        """
        groups, group_size, _ = batch.position.shape
        count = groups * group_size
        position, time_s, scale = _plain(batch.position), batch.time_s, batch.footprint
        color = torch.empty(groups, group_size, 3)
        hits = empty_hits(groups, group_size, color.device) if batch.hits else None
        places = address("position", position, torch.float32, 2 * count)
        colors = address("color", color, torch.float32, 3 * count)
        scales = instances = points = occluders = 0
        if scale is not None:
            scale = _plain(scale)
            scales = address("footprint", scale, torch.float32, count)
        if hits is not None:
            instances = address("instance", hits.instance, torch.int32, count)
            points = address("point", hits.point, torch.float32, 3 * count)
            occluders = address("occluder", hits.occluder, torch.int32, count)
        with self._lock:
            self._taken[:], self._rays[:] = 0, 0
            command, times = self._moving, 0
            if isinstance(time_s, Tensor):
                time_s = time_s.contiguous()
                times = address("time_s", time_s, torch.float64, count)
            else:
                command = self._still
                self._pose(time_s)
            taken, rays = self._counters
            command.set(taken, count, places, times, scales, colors, instances, points, occluders, rays)
            TEAM.run([command] * self._threads)
            return color, self._rays.tolist(), hits


def _plain(values: Tensor) -> Tensor:
    """The values as a contiguous float32 tensor on the CPU."""
    if values.dtype is torch.float32 and values.is_cpu and values.is_contiguous():
        return values
    return values.to("cpu", torch.float32).contiguous()
