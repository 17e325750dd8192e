"""A renderer of a scene whose parts do not all move rigidly: the scene is made anew for each of its poses."""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from renderer.batches import checked, empty_hits
from renderer.tables.origin import Vector, origin_of
from renderer.trace import Renderer
from scenes.canonical import Mesh, Scene
from tsar.types import FrameletBatch, Hits, SampleBatch, Viewpoint

POSES_HZ = 60.0
"""Poses a second. A pose holds from half an interval before its time to half an interval after it."""

STANDING_STILL = (
    "poses that are named are those of the first time: "
    f"what does not move rigidly is read anew {POSES_HZ:g} times a second; policies take its surface as standing still"
)
"""The loss of a scene with poses."""

_POSES_MOST, _FACES_MOST = 16, 1 << 22  # of the renderers that are kept


@dataclass(frozen=True, eq=False)
class _Pose:
    """A renderer of one pose.

    Attributes:
        renderer: renderer of the pose.
        number: for each of its instances, the number of the same one in the first pose, where one more number stands
            for those that have no counterpart.
        track: for each instance of the first pose, and for that number, the rigid motion in this pose, 0 if none.
    """

    renderer: Renderer
    number: Int64[Tensor, " instances"]
    track: Int64[Tensor, " numbers"]


class Poses:
    """Renderers of the poses of a scene; the latest ones are kept.

    Attributes:
        first: renderer of the pose at time zero, which also holds before it.
    """

    def __init__(self, scene_at: Callable[[float], Scene], make: Callable[[Scene, Vector], Renderer]) -> None:
        """Builds the renderer of the first pose.

        Args:
            scene_at: the scene with its pose at a time in seconds; its rigid motions are the same at all times.
            make: builds a renderer of a scene with the given origin.
        """
        self._scene_at, self._make = scene_at, make
        scene = scene_at(0.0)
        self._origin = origin_of(scene)
        self.first = make(scene, self._origin)
        self._names = _names(self.first)
        self._kept: OrderedDict[int, _Pose] = OrderedDict({0: self._numbered(self.first)})

    def numbers(self, time_s: Float64[Tensor, "*shape"]) -> Int64[Tensor, "*shape"]:
        """Numbers of the poses that hold at times in seconds."""
        return (time_s * POSES_HZ).round().clamp(min=0).to(torch.int64)

    def number(self, time_s: float) -> int:
        """Number of the pose that holds at a time in seconds."""
        return int(self.numbers(torch.tensor(time_s, dtype=torch.float64)))

    def pose(self, number: int) -> _Pose:
        """A pose with its renderer."""
        if number not in self._kept:
            made = self.first if number == 0 else self._make(self._scene_at(number / POSES_HZ), self._origin)
            self._kept[number] = self._numbered(made)
            faces = sum(len(part.shape.faces) for part in made.scene.instances if isinstance(part.shape, Mesh))
            while len(self._kept) > max(2, min(_POSES_MOST, _FACES_MOST // max(faces, 1))):
                _, oldest = self._kept.popitem(last=False)
                if oldest.renderer is not self.first:
                    oldest.renderer.close()
        self._kept.move_to_end(number)
        return self._kept[number]

    def _numbered(self, renderer: Renderer) -> _Pose:
        there = {name: number for number, name in enumerate(self._names)}
        names, tracks = _names(renderer), {name[0]: name[1] for name in _tracks(renderer)}
        number = [there.get(name, len(self._names)) for name in names]
        track = [tracks.get(motion, 0) for motion, _ in self._names]
        return _Pose(renderer, torch.tensor(number), torch.tensor([*track, 0]))


class PosedRenderer:
    """As :class:`renderer.trace.Renderer`, for a scene that is made anew for each of its poses.

    Instances are numbered as in the first pose. Those without a counterpart there have one number, which stands still.
    Hits of a surface that does not move rigidly lie on it as it is at their time, and stand still at other times.
    """

    def __init__(self, poses: Poses, footprint_px: float) -> None:
        """A view of poses, which several may share.

        Args:
            poses: the scene.
            footprint_px: number of pixels along the shorter image axis for which :meth:`trace` filters textures.
        """
        self.poses, self.footprint_px = poses, footprint_px
        self.threads, self.random = poses.first.threads, poses.first.random

    def at(self, time_s: float) -> Renderer:
        """The renderer of the pose that holds at a time in seconds."""
        return self.poses.pose(self.poses.number(time_s)).renderer

    def trace(self, batch: FrameletBatch, aspect: float = 1.0) -> SampleBatch:
        """Shades the samples of a batch, each in the pose of its time; arguments, result and errors as of
        :meth:`renderer.trace.Renderer.trace`.

        Where the samples of a row have several poses, the row is traced in each of them, and rays are counted in
        proportion to the samples that are kept.
        """
        batch = checked(batch)
        if not isinstance(batch.time_s, Tensor):
            return self._traced(batch, aspect, self.poses.number(batch.time_s))
        numbers = self.poses.numbers(batch.time_s)
        groups, group_size, _ = batch.position.shape
        color, counters = torch.empty(groups, group_size, 3), Counter[str]()
        hits = empty_hits(groups, group_size, color.device) if batch.hits else None
        for number in numbers.unique().tolist():
            own = numbers == number
            rows = own.any(dim=1)
            found, some = self._traced(_rows(batch, rows), aspect, number), own[rows]
            color[own] = found.color[some].cpu()
            share = float(some.double().mean())
            counters.update({name: round(count * share) for name, count in found.counters.items()})
            if hits is not None and found.hits is not None:
                for name in ("instance", "point", "occluder"):
                    getattr(hits, name)[own] = getattr(found.hits, name)[some].cpu()
        return SampleBatch(color, dict(counters), hits)

    def viewpoint(self, time_s: float, aspect: float = 1.0) -> Viewpoint:
        """Poses of the camera and all instances of the first pose; as of :meth:`renderer.trace.Renderer.viewpoint`."""
        pose = self.poses.pose(self.poses.number(time_s))
        return replace(pose.renderer.viewpoint(time_s, aspect), track_of_instance=pose.track)

    def render_frame(self, time_s: float, width_px: int, height_px: int, samples_per_axis: int = 1) -> Tensor:
        """Renders a whole picture; as of :meth:`renderer.trace.Renderer.render_frame`."""
        return self.at(time_s).render_frame(time_s, width_px, height_px, samples_per_axis)

    def _traced(self, batch: FrameletBatch, aspect: float, number: int) -> SampleBatch:
        pose = self.poses.pose(number)
        found = pose.renderer.trace(batch, aspect, self.footprint_px)
        if found.hits is None:
            return found
        hits, there = found.hits, len(pose.track) - 1
        instance, occluder = (_renumbered(one, pose.number) for one in (hits.instance, hits.occluder))
        point, new = hits.point, instance == there
        if bool(new.any()):
            at_s = number / POSES_HZ if isinstance(batch.time_s, Tensor) else batch.time_s
            point = torch.where(new[..., None], _in_the_world(pose.renderer.viewpoint(at_s), hits), point)
        return replace(found, hits=Hits(instance, point, occluder))


def renderers(
    scene: Scene, scene_at: Callable[[float], Scene] | None, make: Callable[[Scene, float, Vector | None], Renderer]
) -> Callable[[float], Renderer | PosedRenderer]:
    """Makes renderers of a scene for numbers of pixels along the shorter image axis for which textures are filtered.

    Args:
        scene: the scene.
        scene_at: the scene with its pose at a time in seconds; None if all of its parts move rigidly.
        make: builds a renderer of a scene, for such a number and with an origin.
    """
    if scene_at is None:
        return lru_cache(maxsize=8)(lambda footprint_px: make(scene, footprint_px, None))
    poses = Poses(scene_at, lambda posed, origin: make(posed, 512.0, origin))
    return lambda footprint_px: PosedRenderer(poses, footprint_px)


def renderer_at(renderer: Renderer | PosedRenderer, time_s: float) -> Renderer:
    """The renderer of a scene at a time in seconds."""
    return renderer.at(time_s) if isinstance(renderer, PosedRenderer) else renderer


def _rows(batch: FrameletBatch, rows: Tensor) -> FrameletBatch:
    """Some rows of a batch whose samples have times of their own."""
    assert isinstance(batch.time_s, Tensor)
    footprint = None if batch.footprint is None else batch.footprint[rows]
    own = {"level": batch.level[rows], "index": batch.index[rows], "position": batch.position[rows]}
    return replace(batch, **own, time_s=batch.time_s[rows], footprint=footprint)


def _renumbered(instance: Tensor, number: Int64[Tensor, " instances"]) -> Tensor:
    """Numbers of instances in the first pose; negative ones are kept."""
    return torch.where(instance < 0, instance, number.to(instance.dtype)[instance.clamp(min=0).to(torch.int64)])


def _in_the_world(view: Viewpoint, hits: Hits) -> Tensor:
    """Points of hits, of any instance, in the world."""
    track = view.track_of_instance[hits.instance.clamp(min=0).to(torch.int64)]
    turned = (view.rotation[track] * hits.point[..., None, :]).sum(dim=-1)
    return (turned + view.translation[track]).to(hits.point.dtype)


def _tracks(renderer: Renderer) -> list[tuple[bytes, int]]:
    """The rigid motions of a renderer, by content, with their numbers."""
    tracks = enumerate(renderer.buffers.tracks.tracks)
    return [(b"" if n == 0 else track.translation.tobytes() + track.rotation.tobytes(), n) for n, track in tracks]


def _names(renderer: Renderer) -> list[tuple[bytes, int]]:
    """A name for each instance that is the same in all poses: its rigid motion, and its place among those of it."""
    motions, counts = dict((n, content) for content, n in _tracks(renderer)), Counter[bytes]()
    found = []
    for track in renderer.buffers.track_of_instance.tolist():
        found.append((motions[track], counts[motions[track]]))
        counts[motions[track]] += 1
    return found
