"""The stages of the filter as kernels on the CPU, with the bits of the reference; threads take rows."""

from __future__ import annotations

from dataclasses import fields
from itertools import pairwise
from math import inf

import numpy as np
import torch
from torch import Tensor

from renderer.compute.launching import Command, address
from renderer.compute.memory import Memory, Recycled
from renderer.compute.team import TEAM
from renderer.stages import filtering_kernels as kernels
from renderer.stages.sizes import FRAME, PIXEL_WORDS
from tsar.filtering.batches import Traced
from tsar.filtering.records import ELEMENT_PX, TILE_SIDE, VARIANCE_MAX, Change, Estimates, FilterOptions, Surfels
from tsar.filtering.stages import FilterStages
from tsar.filtering.tiles import filled_up, spacings
from tsar.projection import to_camera
from tsar.types import Viewpoint

_F32, _F64, _I64 = torch.float32, torch.float64, torch.int64
_KINDS = {
    "color": (3, _F32), "aged": (1, _F32), "inverse": (1, _F32), "time_s": (1, _F64), "roughness": (1, _F32),
    "instance": (1, _I64), "point": (3, _F32), "position": (2, _F32), "step": (2, _F32),
}  # fmt: skip
"""Planes of estimates and surfels, in the order of the native records, and the kind of their elements."""

_APART = 320
"""Bytes between planes, which are read and written together: addresses that differ by whole pages alone take turns."""


def filter_stages(side: int, threads: int = 1) -> FilterStages:
    """Kernels for a picture of ``side`` pixels, a power of two of at least 16."""
    made = _Compiled(side, threads)
    return FilterStages(made.moved, made.chosen, made.taken_in, made.smoothed)


class _Compiled:
    """Recorded launches and working memory for one size, nothing of a run."""

    def __init__(self, side: int, threads: int) -> None:
        self._side, self._pixels, self._memory = side, side * side, Memory()
        room = self._memory.room
        self._plans = [kernels.FilterPlan() for _ in range(2)]
        motion, depth = room("motion", 4 * self._pixels), room("depth", self._pixels, _F64)
        frame = (side + 2) * (side + 2 * FRAME)
        front = self._memory.keep("front", torch.full((frame,), inf, dtype=_F64), _F64, frame)
        source = room("source", self._pixels, torch.int32)
        slot = self._memory.keep("slot", torch.full((self._pixels,), -1, dtype=torch.int32), torch.int32, self._pixels)
        pixel = room("pixel", self._pixels * PIXEL_WORDS, _I64)  # more than the image has are never hit
        done = self._memory.zeros("done", self._pixels, torch.uint8)
        for perspective, plan in enumerate(self._plans):
            plan.side, plan.perspective = side, perspective
            plan.motion, plan.depth, plan.source, plan.front = motion, depth, source, front
            plan.slot, plan.pixel, plan.done = slot, pixel, done
        edges = [side * number // threads for number in range(threads + 1)]
        self._rows = [(a, b) for a, b in pairwise(edges) if b > a]
        self._bands = np.zeros((len(self._rows), 5), np.int64)  # surfels::Band
        for number, (first, last) in enumerate(self._rows):
            least = room(f"least {number}", (last - first + 4) * (side + 4), _I64)
            crossing = room(f"crossing {number}", 3 * (last - first) * side // 8, torch.int32)
            self._bands[number] = first, last, least, crossing, 0
        bands, numbers = address("bands", self._bands, _I64, self._bands.size), range(len(self._rows))
        self._offer = [[Command(kernels.offer, plan, bands, number) for number in numbers] for plan in self._plans]
        count = len(self._rows)
        self._choose = [
            [Command(kernels.choose, plan, bands, count, number) for number in numbers] for plan in self._plans
        ]
        self._sizes = [planes * self._pixels * kind.itemsize for planes, kind in _KINDS.values()]
        self._recycled = Recycled(sum(self._sizes) + _APART * len(_KINDS))
        self._planes = np.zeros(2 * len(_KINDS) - 1, np.int64)
        planes = address("planes", self._planes, _I64, len(self._planes))
        self._take = [Command(kernels.take, self._plans[0], bands, number, planes) for number in numbers]
        self._addresses = np.zeros(6 + len(_KINDS) + 8, np.int64)
        addresses = address("addresses", self._addresses, _I64, len(self._addresses))
        self._take_in = [Command(kernels.take_in, plan, addresses) for plan in self._plans]
        self._prepare_tiles()
        self._prepare_picture()

    def moved(self, estimates: Estimates, surfels: Surfels, view: Viewpoint) -> tuple[Estimates, Surfels]:
        """As :func:`tsar.filtering.motion.moved`."""
        rows = _rows(view)
        before = _planes(estimates, surfels)
        after = self._new_planes()
        where = [self._address(name, plane) for name, plane in zip(_KINDS, before, strict=True)]
        self._planes[:] = [
            *where[:-1], *(self._address(name, plane) for name, plane in zip(_KINDS, after, strict=True))
        ]  # fmt: skip
        at = dict(zip(_KINDS, where, strict=True))
        names = "instance", "point", "aged", "inverse", "roughness"
        arguments = *_poses(rows, view), *(at[name] for name in names)
        perspective = view.kind == "perspective"
        offer, choose = self._offer[perspective], self._choose[perspective]
        for one, other in zip(offer, choose, strict=True):
            one.set(*arguments, at["position"])
            other.set(*arguments)
        for commands in (offer, choose, self._take):
            TEAM.run(commands)
        return Estimates(*after[:5]), Surfels(*after[5:])

    def taken_in(
        self, estimates: Estimates, surfels: Surfels, known: Change, traced: Traced, options: FilterOptions
    ) -> tuple[Estimates, Surfels, Change]:
        """As :func:`tsar.filtering.batches.taken_in`; estimates that were moved are changed in place."""
        hits, view, tiles = traced.hits, traced.view, len(traced.color)
        moves = view is not None and hits is not None
        planes = _planes(estimates, surfels)
        if not moves:  # aged, but for that those of the cycle before
            planes[:5] = [plane.clone() for plane in planes[:5]]
        samples = tiles * TILE_SIDE**2
        batch = [
            (traced.color, _F32, 3 * samples), (traced.position, _F32, 2 * samples), (traced.time_s, _F64, samples),
            (traced.spacing, _F32, tiles),
        ]  # fmt: skip
        if hits is not None:
            batch += [(hits.instance, torch.int32, samples), (hits.point, _F32, 3 * samples)]
        kept = [values.contiguous() for values, _, _ in batch]
        elements = (self._side // ELEMENT_PX) ** 2
        before = [known.excess.contiguous(), known.span_s.contiguous(), known.seen_s.contiguous()]
        after = [torch.empty_like(plane) for plane in (*before, known.rate, known.rate)]
        changes = [address("change", plane, plane.dtype, elements) for plane in (*before, *after)]
        where = [address("batch", values, *kind) for values, (_, *kind) in zip(kept, batch, strict=True)]
        where += [0] * (6 - len(where))
        own = [self._address(name, plane) for name, plane in zip(_KINDS, planes, strict=True)]
        self._addresses[:] = [*where, *own, *changes]
        moment = traced.now_s, options.memory_s, VARIANCE_MAX / traced.cycle_s
        parts = moves, options.accumulation, options.spread
        views = [seen if moves else None for seen in (view, traced.earlier)]
        rows = [_rows(seen) if seen is not None else None for seen in views]
        poses = [_poses(row, seen) for row, seen in zip(rows, views, strict=True)]
        command = self._take_in[view is None or view.kind == "perspective"]
        command(tiles, *moment, *map(int, parts), *poses[0], *poses[1])
        return Estimates(*planes[:5]), Surfels(*planes[5:]), Change(*after[:4])

    def chosen(
        self,
        variance: Tensor,
        roughness: Tensor,
        rate: Tensor,
        speed: Tensor,
        cycle_s: float,
        count: int,
        options: FilterOptions,
    ) -> list[Tensor]:
        """As :func:`tsar.filtering.tiles.chosen`."""
        planes = {"variance": variance, "roughness": roughness, "rate": rate, "speed": speed}
        kept = {name: plane.contiguous() for name, plane in planes.items()}
        where = [address(name, plane, _F32, self._pixels) for name, plane in kept.items()]
        lengths = cycle_s, options.reach * self._side, options.life_min_s, options.life_max_s
        for (spacing, tiles, plane, gain), command in zip(self._levels, self._gain, strict=True):
            command.set(spacing, *lengths, self._side, tiles, *where, plane, gain)
        for first in range(0, len(self._gain), len(self._rows)):
            TEAM.run(self._gain[first : first + len(self._rows)])
        self._best(count)
        found = [level.bool() for level in self._split(self._taken)]
        gains = self._split(self._gains)
        return filled_up(found, gains, self._spacings.index(1.0), count)

    def smoothed(self, color: Tensor, variance: Tensor, roughness: Tensor) -> tuple[Tensor, Tensor]:
        """As :func:`tsar.filtering.display.smoothed`."""
        levels, fine = self._pyramid, (color, variance, roughness)
        finest = levels[: 5 * self._pixels].reshape(5, self._side, self._side)
        torch.cat(fine, out=finest)
        self._smooth()
        return finest[:3].clone(), finest[3:4].clone()

    def _prepare_tiles(self) -> None:
        self._spacings = spacings(self._side)
        sides = [int(self._side / (TILE_SIDE * spacing)) for spacing in self._spacings]
        self._sides, total = sides, sum(side * side for side in sides)
        self._gains, self._taken = torch.zeros(total, dtype=_F64), torch.zeros(total, dtype=torch.uint8)
        room, gains = self._memory.room, address("gains", self._gains, _F64, total)
        starts = np.cumsum([0, *(side * side for side in sides)])
        self._levels = [
            (spacing, side, room(f"plane {side}", self._pixels * 3 // 2), gains + 8 * int(start))
            for spacing, side, start in zip(self._spacings, sides, starts, strict=False)
        ]
        self._gain = [Command(kernels.gain) for _ in self._levels]
        best = Command(kernels.best)
        memory = room("value", total, _F64), room("count", total, torch.int32)
        taken = address("taken", self._taken, torch.uint8, total)
        self._best = lambda count: best(gains, len(sides), sides[0], count, *memory, taken)

    def _prepare_picture(self) -> None:
        pixels, wide = 0, self._side
        while wide >= 1:
            pixels, wide = pixels + wide * wide, wide // 2
        self._pyramid = torch.zeros(5 * pixels)
        levels = address("levels", self._pyramid, _F32, 5 * pixels)
        spare = self._memory.room("spare", 2 * self._pixels)
        self._smooth = Command(kernels.smooth, levels, self._side, spare).launch

    def _split(self, values: Tensor) -> list[Tensor]:
        sizes = [side * side for side in self._sides]
        return [part.reshape(side, side) for part, side in zip(values.split(sizes), self._sides, strict=True)]

    def _new_planes(self) -> list[Tensor]:
        block, made, start = self._recycled.block(), [], 0
        for (planes, kind), size in zip(_KINDS.values(), self._sizes, strict=True):
            made.append(block[start : start + size].view(kind).reshape(planes, self._side, self._side))
            start += size + _APART
        return made

    def _address(self, name: str, plane: Tensor) -> int:
        planes, kind = _KINDS[name]
        return address(name, plane, kind, planes * self._pixels)


def _rows(view: Viewpoint) -> Tensor:
    """What takes each instance to the camera, and last of all directions."""
    matrix, offset = to_camera(view)
    return torch.cat((matrix.reshape(-1, 9), offset), dim=1).contiguous()


def _poses(rows: Tensor | None, view: Viewpoint | None) -> tuple[int, int, float, float]:
    """A view as a launch takes it; 0 where there is none."""
    if rows is None or view is None:
        return 0, 0, 1.0, 1.0
    return address("rows", rows, _F64, rows.numel()), len(rows), view.tan_x, view.tan_y


def _planes(estimates: Estimates, surfels: Surfels) -> list[Tensor]:
    """In the order of :data:`_KINDS`, each contiguous."""
    return [getattr(record, field.name).contiguous() for record in (estimates, surfels) for field in fields(record)]
