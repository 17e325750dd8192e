"""Batches of samples through packets, at little cost beside the tracing itself."""

from __future__ import annotations

import threading

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


class PacketBatches:
    """Shades lists of samples for one camera and one footprint, on the CPU. Calls from several threads take turns."""

    def __init__(self, buffers: SceneBuffers, still: ViewData, moving: ViewData, threads: int) -> None:
        """Records the launches.

        Args:
            buffers: the scene.
            still, moving: two records of the camera, for samples of one time and of many; ``still`` is changed here.
            threads: host threads that share a batch, the caller's among them.
        """
        count = len(buffers.tracks.tracks)
        still.pose_translation = wp.empty(count, wp.vec3, "cpu")
        still.pose_rotation = wp.empty(count, wp.quat, "cpu")
        still.single_time = 1
        poses = still.pose_translation, still.pose_rotation
        self._pose = Command(kernels.pose_tracks, buffers.data, moving, *poses, size=count)
        self._still, self._moving = (Command(packets.shade_samples, buffers.data, view) for view in (still, moving))
        self._keep = buffers, still, moving  # launches know their arrays by address only
        self._threads, self._lock = threads, threading.Lock()
        self._taken, self._rays = np.zeros(1, np.int32), np.zeros(2, np.int64)
        self._counters = address("taken", self._taken, torch.int32, 1), address("rays", self._rays, torch.int64, 2)

    def shade(self, position: Tensor, time_s: Tensor | float) -> tuple[Tensor, int, int]:
        """Colours ``(n, s, 3)`` float32, and how many shadow rays and reflections they took.

        Args:
            position: ``(n, s, 2)`` float32 on the image plane.
            time_s: ``(n, s)`` animation times, or one for all samples.
        """
        groups, group_size, _ = position.shape
        color = torch.empty(groups, group_size, 3)
        count = groups * group_size
        places = address("position", position, torch.float32, 2 * count)
        colors = address("color", color, torch.float32, 3 * count)
        with self._lock:
            self._taken[:], self._rays[:] = 0, 0
            command, times = self._moving, 0
            if isinstance(time_s, Tensor):
                time_s = time_s.to(torch.float64).contiguous()
                times = address("time_s", time_s, torch.float64, count)
            else:
                command = self._still
                self._pose(time_s)
            taken, rays = self._counters
            command.set(taken, count, places, times, colors, rays)
            TEAM.run([command] * self._threads)
            shadow, reflection = self._rays.tolist()
        return color, shadow, reflection
