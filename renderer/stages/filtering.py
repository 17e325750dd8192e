"""The stages of the filter as CPU kernels with the same bits as the reference; threads share rows."""

from __future__ import annotations

from dataclasses import fields
from math import inf

import numpy as np
import torch
from torch import Tensor

from renderer.compute.launching import Command, NativeRecord, address
from renderer.compute.memory import Memory, Recycled
from renderer.compute.team import TEAM, shares
from renderer.stages import filtering_kernels as kernels
from renderer.stages import picture_kernels
from renderer.stages.noise import Detailed
from renderer.stages.poses import pose_words
from renderer.stages.sizes import FRAME, LEVEL_PLANES, PIXEL_WORDS
from tsar.filtering.batches import Traced
from tsar.filtering.options import FilterOptions
from tsar.filtering.records import ELEMENT_PX, TILE_SIDE, VARIANCE_MAX, Change, Estimates, Surfels
from tsar.filtering.stages import FilterStages
from tsar.filtering.tiles import filled_up, spacings
from tsar.types import Hits, Viewpoint

_F32, _F64, _I64 = torch.float32, torch.float64, torch.int64
_KINDS = {
    "color": (3, _F32), "aged": (1, _F32), "inverse": (1, _F32), "time_s": (1, _F64), "roughness": (1, _F32),
    "instance": (1, _I64), "point": (3, _F32), "position": (2, _F32), "step": (2, _F32),
}  # fmt: skip
"""Planes of estimates and surfels in the order of the native records: their number and element type."""

_APART = 320  # bytes between planes, which avoids cache conflicts of addresses that differ by whole pages


def filter_stages(side: int, threads: int = 1, picture: tuple[int, int] | None = None) -> FilterStages:
    """Kernels for a plane of ``side`` pixels, a power of two of at least 16. ``picture`` is the height and width of the
    picture within it, by default the whole plane."""
    made = _Compiled(side, threads, picture or (side, side))
    detailed = Detailed(side, threads, picture or (side, side))
    return FilterStages(made.advanced, made.chosen, made.taken_in, made.drifted, detailed, made.displayed)


class _Compiled:
    """Recorded launches and working memory for one size, without state of a run."""

    def __init__(self, side: int, threads: int, picture: tuple[int, int]) -> None:
        self._side, self._pixels, self._memory = side, side * side, Memory()
        self._height, self._width = picture
        room = self._memory.room
        self._plans = [kernels.FilterPlan() for _ in range(2)]
        motion, depth = room("motion", 4 * self._pixels), room("depth", self._pixels, _F64)
        aged = room("aged", self._pixels)
        frame = (side + 2) * (side + 2 * FRAME)
        front = self._memory.keep("front", torch.full((frame,), inf, dtype=_F64), _F64, frame)
        source = room("source", self._pixels, torch.int32)
        slot = self._memory.keep("slot", torch.full((self._pixels,), -1, dtype=torch.int32), torch.int32, self._pixels)
        pixel = room("pixel", self._pixels * PIXEL_WORDS, _I64)  # at most one for each pixel of the image
        for perspective, plan in enumerate(self._plans):
            plan.side, plan.perspective = side, perspective
            plan.height, plan.width = picture
            plan.motion, plan.aged, plan.depth, plan.source, plan.front = motion, aged, depth, source, front
            plan.slot, plan.pixel = slot, pixel
        self._rows = shares(side, threads)
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
        self._prepare_batch(threads)
        self._shadows = NativeRecord("2Q q 4Q q Q Qqdd Qqdd qd")  # shadows::Batch
        self._drifted = Command(kernels.drifted, self._shadows.address).launch
        self._prepare_tiles(threads)
        self._prepare_picture(threads)

    def advanced(
        self, estimates: Estimates, surfels: Surfels, rate: Tensor, seconds: float, view: Viewpoint
    ) -> tuple[Estimates, Surfels]:
        """Like :func:`tsar.filtering.motion.advanced`."""
        rate = rate.contiguous()
        before = _planes(estimates, surfels)
        after = self._new_planes()
        where = [self._address(name, plane) for name, plane in zip(_KINDS, before, strict=True)]
        self._planes[:] = [
            *where[:-1], *(self._address(name, plane) for name, plane in zip(_KINDS, after, strict=True))
        ]  # fmt: skip
        at = dict(zip(_KINDS, where, strict=True))
        of = *pose_words(view), *(at[name] for name in ("instance", "point", "inverse", "roughness"))
        ageing = at["position"], at["aged"], self._elements(rate), seconds
        perspective = view.kind == "perspective"
        offer, choose = self._offer[perspective], self._choose[perspective]
        for one, other in zip(offer, choose, strict=True):
            one.set(*of, *ageing)
            other.set(*of)
        for commands in (offer, choose, self._take):
            TEAM.run(commands)
        return Estimates(*after[:5]), Surfels(*after[5:])

    def taken_in(
        self, estimates: Estimates, surfels: Surfels, known: Change, traced: Traced, options: FilterOptions
    ) -> tuple[Estimates, Surfels, Change]:
        """Like :func:`tsar.filtering.batches.taken_in`; estimates that were moved are changed in place."""
        hits, view, tiles = traced.hits, traced.view, len(traced.color)
        moves = view is not None and hits is not None
        planes = _planes(estimates, surfels)
        if not moves:  # these share planes with the cycle before
            planes[:5] = [plane.clone() for plane in planes[:5]]
        samples = tiles * TILE_SIDE**2
        if samples > self._pixels:
            raise ValueError(f"batch: expected at most {self._pixels} samples, got {samples}")
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
        where = [address("batch", plane, kind, size) for plane, (_, kind, size) in zip(kept, batch, strict=True)]
        where += [0] * (6 - len(where))
        own = [self._address(name, plane) for name, plane in zip(_KINDS, planes, strict=True)]
        now, was = (pose_words(seen if moves else None) for seen in (view, traced.earlier))
        moment = traced.now_s, options.memory_s, VARIANCE_MAX / traced.cycle_s
        flags = moves, options.accumulation, options.spread
        self._batch.set(*where, tiles, *own, *changes, *self._samples, *now, *was, *moment, *map(int, flags))
        perspective = view is None or view.kind == "perspective"
        locate = self._locate[perspective]
        for command, (first, last) in zip(locate, shares(tiles, len(locate)), strict=False):
            command.set(first, last)
        TEAM.run(locate[: len(shares(tiles, len(locate)))])
        for commands in (self._gather, self._learn, self._take_in):
            TEAM.run(commands)
        return Estimates(*planes[:5]), Surfels(*planes[5:]), Change(*after[:4])

    def chosen(
        self,
        variance: Tensor,
        roughness: Tensor,
        rate: Tensor,
        surfels: Surfels | None,
        cycle_s: float,
        count: int,
        options: FilterOptions,
    ) -> list[Tensor]:
        """Like :func:`tsar.filtering.tiles.chosen`."""
        kept = [("variance", variance), ("roughness", roughness), ("rate", rate)]
        if surfels is not None:
            kept += [("step", surfels.step), ("instance", surfels.instance)]
        planes = [(name, plane.contiguous()) for name, plane in kept]
        where = [self._elements(one) if name == "rate" else self._address(name, one) for name, one in planes]
        where += [0] * (5 - len(where))
        lengths = cycle_s, options.reach * self._side, options.life_min_s, options.life_max_s
        for command in self._gain:
            command.set(*where, *lengths)
        TEAM.run(self._gain)
        self._gains[: self._unfit] = 0.0
        self._best(count)
        found = self._split(self._taken.clone())
        if int(self._found[0]) == count:
            return found
        return filled_up(found, self._split(self._gains), self._spacings.index(1.0), count)

    def drifted(
        self, before: Tensor, position: Tensor, hits: Hits, view: Viewpoint, earlier: Viewpoint, cycle_s: float
    ) -> Tensor:
        """Like :func:`tsar.filtering.shadows.drifted`."""
        before, samples, after = before.contiguous(), hits.instance.numel(), torch.empty_like(before)
        planes = [
            (position, _F32, 2 * samples), (hits.instance, torch.int32, samples), (hits.point, _F32, 3 * samples),
            (hits.occluder, torch.int32, samples),
        ]  # fmt: skip
        kept = [values.contiguous() for values, _, _ in planes]
        where = [address("batch", plane, kind, size) for plane, (_, kind, size) in zip(kept, planes, strict=True)]
        track, now, was = view.track_of_instance.contiguous(), pose_words(view), pose_words(earlier)
        self._shadows.set(
            self._elements(before), self._elements(after), self._side // ELEMENT_PX, *where, samples,
            address("tracks", track, _I64, len(track)), *now, *was, earlier.kind == "perspective", cycle_s,
        )  # fmt: skip
        self._drifted()
        return after

    def displayed(
        self,
        estimates: Estimates,
        surfels: Surfels | None,
        rate: Tensor,
        seconds: float,
        between: Tensor | None = None,
    ) -> tuple[Tensor, Tensor]:
        """Like :func:`tsar.filtering.display.displayed`."""
        planes = {name: getattr(estimates, name) for name in ("color", "roughness", "aged", "inverse")}
        planes |= {"between": planes["roughness"] if between is None else between}
        planes |= {"position": surfels.position} if surfels is not None else {}
        rate, planes = rate.contiguous(), {name: plane.contiguous() for name, plane in planes.items()}
        at = {name: self._address(name, plane) for name, plane in planes.items()}
        block = self._pictures.block().view(_F32)
        where, (variance, levels) = address("picture", block, _F32, 4 * self._pixels), self._room
        self._picture[:] = [
            at["color"], at["between"], variance,
            at["aged"], at["inverse"], at["roughness"], self._elements(rate), at.get("position", 0),
            levels, where, where + 4 * 3 * self._pixels, self._width, self._height,
        ]  # fmt: skip
        for command in self._shrink:
            command.set(seconds)
        TEAM.run(self._shrink)
        self._smooth()
        TEAM.run(self._show)
        found, remaining = block.split([3 * self._pixels, self._pixels])
        color, remaining = found.view(self._side, self._side, 3), remaining.view(1, self._side, self._side)
        for plane in (color, remaining[0]):
            plane[self._height :] = plane[:, self._width :] = 0.0
        return color.permute(2, 0, 1), remaining

    def _prepare_batch(self, threads: int) -> None:
        room, pixels = self._memory.room, self._pixels
        self._samples = [room("at", pixels, torch.int32), *(room(f"samples {k}", pixels) for k in range(5))]
        self._batch = NativeRecord("6Q Q 9Q 8Q 6Q Qqdd Qqdd 3d 3q")  # batches::Batch
        rows = [(ELEMENT_PX * a, ELEMENT_PX * b) for a, b in shares(self._side // ELEMENT_PX, threads)]
        sums = [room(f"sums {number}", 9 * (self._side + 16)) for number in range(len(rows))]
        self._parts = np.array(
            [(*share, 0, at) for share, at in zip(rows, sums, strict=True)], np.int64
        )  # batches::Part
        batch, parts, count = self._batch.address, address("parts", self._parts, _I64, 4 * len(rows)), len(rows)
        self._locate = [[Command(kernels.locate, plan, batch) for _ in range(threads)] for plan in self._plans]
        plan = self._plans[0]
        self._gather = [Command(kernels.gather, plan, batch, parts, number) for number in range(count)]
        self._learn = [Command(kernels.learn, plan, batch, parts, number) for number in range(count)]
        self._take_in = [Command(kernels.take_in, plan, batch, parts, number) for number in range(count)]

    def _prepare_tiles(self, threads: int) -> None:
        self._spacings = spacings(self._side)
        sides = [int(self._side / (TILE_SIDE * spacing)) for spacing in self._spacings]
        self._sides, total = sides, sum(side * side for side in sides)
        fit = len(spacings(min(self._height, self._width)))  # tiles of the levels before are too wide
        self._unfit = sum(side * side for side in sides[: len(sides) - fit])
        self._gains, self._taken = torch.zeros(total, dtype=_F64), torch.zeros(total, dtype=torch.bool)
        self._found = np.zeros(1, np.int32)
        gains, taken = address("gains", self._gains, _F64, total), address("taken", self._taken, torch.bool, total)
        fixed = self._side, sides[0], len(sides), self._spacings[0], gains
        self._gain = [Command(picture_kernels.gain, *fixed, *rows) for rows in shares(sides[0], threads)]
        found = address("found", self._found, torch.int32, 1)
        most = self._memory.room("most", total, _F64)
        self._best = Command(picture_kernels.best, gains, len(sides), sides[0], most, taken, found)

    def _prepare_picture(self, threads: int) -> None:
        side, pixels = self._side, self._pixels
        self._pictures = Recycled(4 * 4 * pixels)
        self._picture = np.zeros(13, np.int64)  # pyramid::Picture
        levels = sum(LEVEL_PLANES * 4**level for level in range(side.bit_length() - 1))
        self._room = self._memory.room("variance", pixels), self._memory.room("levels", levels)
        picture = address("picture", self._picture, _I64, 13)
        spare = [self._memory.room(f"spare {number}", 16 * side) for number in range(threads)]
        rows = list(enumerate(shares(-(-self._height // 2), threads)))
        self._shrink = [Command(picture_kernels.shrink, picture, side, *share, spare[number]) for number, share in rows]
        self._show = [Command(picture_kernels.show, picture, side, *share, spare[number]) for number, share in rows]
        self._smooth = Command(
            picture_kernels.smooth, self._room[1], side // 2, -(-self._width // 2), -(-self._height // 2), spare[0]
        ).launch

    def _split(self, values: Tensor) -> list[Tensor]:
        sizes = [side * side for side in self._sides]
        return [part.reshape(side, side) for part, side in zip(values.split(sizes), self._sides, strict=True)]

    def _new_planes(self) -> list[Tensor]:
        block, made, start = self._recycled.block(), [], 0
        for (planes, kind), size in zip(_KINDS.values(), self._sizes, strict=True):
            made.append(block[start : start + size].view(kind).reshape(planes, self._side, self._side))
            start += size + _APART
        return made

    def _elements(self, rate: Tensor) -> int:
        return address("rate", rate, _F32, self._pixels // ELEMENT_PX**2)

    def _address(self, name: str, plane: Tensor) -> int:
        planes, kind = _KINDS.get(name, (1, _F32))
        return address(name, plane, kind, planes * self._pixels)


def _planes(estimates: Estimates, surfels: Surfels) -> list[Tensor]:
    """The planes in the order of :data:`_KINDS`, each contiguous."""
    return [getattr(record, field.name).contiguous() for record in (estimates, surfels) for field in fields(record)]
