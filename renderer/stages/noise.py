"""Noise told from detail by a CPU kernel with the same bits as the reference; threads share rows."""

from __future__ import annotations

import torch
from torch import Tensor

from renderer.compute.launching import Command, NativeRecord, address
from renderer.compute.memory import Memory, Recycled
from renderer.compute.team import TEAM, shares
from renderer.stages import picture_kernels
from renderer.stages.sizes import NOISE_ROWS
from tsar.filtering.records import Estimates


class Detailed:
    """Recorded launches and working memory for one size, without state of a run."""

    def __init__(self, side: int, threads: int, picture: tuple[int, int]) -> None:
        """Prepares the launches for a plane of ``side`` pixels, of which the upper left ``picture``, height and width,
        is shown."""
        self._side, (self._height, self._width) = side, picture
        self._memory, self._found = Memory(), Recycled(4 * side * side)
        self._planes = NativeRecord("4Q 3q")  # noise::Planes
        spare = [self._memory.room(f"spare {number}", NOISE_ROWS * self._width) for number in range(threads)]
        self._commands = [
            Command(picture_kernels.detailed, self._planes.address, *rows, spare[number])
            for number, rows in enumerate(shares(self._height, threads))
        ]

    def __call__(self, estimates: Estimates) -> Tensor:
        """Like :func:`tsar.filtering.noise.detailed`."""
        pixels, found = self._side * self._side, self._found.block().view(torch.float32)
        planes = [plane.contiguous() for plane in (estimates.color, estimates.roughness, estimates.inverse)]
        sizes = 3 * pixels, pixels, pixels, pixels
        where = [address("plane", *of) for of in zip((*planes, found), [torch.float32] * 4, sizes, strict=True)]
        self._planes.set(*where, self._side, self._width, self._height)
        TEAM.run(self._commands)
        plane = found.view(1, self._side, self._side)
        plane[:, self._height :] = plane[:, :, self._width :] = 0.0
        return plane
