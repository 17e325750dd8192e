"""Transforms of the prims of a USD stage, and their rigid motion at uniform times."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import affine, inverse, product
from scenes.canonical import Matrix, RigidTrack, SceneError
from scenes.models.motion import Pose, rigid_track, uniform_times
from scenes.models.usd_library import Usd, UsdGeom


class UsdMotion:
    """The animation of a stage. It starts with the stage, or with the first time sample of a transform.

    Attributes:
        pose: time at which everything is read that does not move rigidly.
        code: its time code.
        moves: whether any transform changes over time.
    """

    def __init__(self, stage: Any, pose: Pose) -> None:
        self._rate = float(stage.GetTimeCodesPerSecond()) or 24.0
        within = (prim for prototype in stage.GetPrototypes() for prim in Usd.PrimRange(prototype))
        every = (UsdGeom.Xformable(prim) for prim in itertools.chain(stage.Traverse(), within))
        samples = [code for xform in every if xform for code in xform.GetTimeSamples()]
        given = stage.HasAuthoredTimeCodeRange()
        first = stage.GetStartTimeCode() if given else min(samples, default=0.0)
        last = stage.GetEndTimeCode() if given else max(samples, default=first)
        self._start = first
        self._last_s = (last - first) / self._rate if samples else 0.0
        self.pose, self.code = pose, Usd.TimeCode(first + pose.time_s * self._rate)
        self._first, self._now = UsdGeom.XformCache(Usd.TimeCode(first)), UsdGeom.XformCache(self.code)
        self.moves = bool(samples)
        self._movers: dict[str, str] = {"/": ""}
        self._tracks: dict[str, RigidTrack] = {}

    def matrix(self, prim: Any) -> Matrix:
        """The transform from a prim to the world: at the start for those of :meth:`tracks`, else at the pose.

        Raises:
            SceneError: it is not finite.
        """
        cache = self._first if self.mover(prim) in self._tracks else self._now
        return _finite(cache.GetLocalToWorldTransform(prim), prim)

    def matrices(self, prims: list[Any]) -> NDArray[np.float64]:
        """Transforms ``(n, 4, 4)`` from prims to the world of a stage that does not move.

        Raises:
            SceneError: one is not finite.
        """
        world = [self._now.GetLocalToWorldTransform(prim) for prim in prims]
        found = np.array(world, np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
        plain = np.isfinite(found).all(axis=(1, 2)) & (found[:, 3] == (0.0, 0.0, 0.0, 1.0)).all(axis=1)
        for number in np.flatnonzero(~plain).tolist():
            found[number] = _finite(world[number], prims[number])
        return found

    def relative(self, prim: Any, above: Any) -> Matrix | None:
        """The transform from a prim to one above it; None if it does not follow it."""
        found, reset = self._now.ComputeRelativeTransform(prim, above)
        return None if reset else _finite(found, prim)

    def matrix_below(self, prim: Any, root: Any) -> Matrix:
        """The transform from a prim of a prototype to the space of its instances, with that of its root."""
        above = self._now.GetParentToWorldTransform(root)
        return product(inverse(_finite(above, root)), _finite(self._now.GetLocalToWorldTransform(prim), prim))

    def mover(self, prim: Any) -> str:
        """The path of the nearest prim at or above a prim that moves; empty if there is none."""
        if not self.moves:
            return ""
        path = str(prim.GetPath())
        if path not in self._movers:
            xform = UsdGeom.Xformable(prim)
            if xform and xform.TransformMightBeTimeVarying():
                self._movers[path] = path
            elif xform and xform.GetResetXformStack():
                self._movers[path] = ""
            else:
                self._movers[path] = self.mover(prim.GetParent())
        return self._movers[path]

    def tracks(self, prims: list[Any]) -> dict[str, RigidTrack]:
        """The rigid motion of all prims that move, by their paths; motion that is not rigid is noted.

        Raises:
            SceneError: the animation is too long.
        """
        times_s = uniform_times(self._last_s)
        paths = sorted({self.mover(prim) for prim in prims} - {""}) if len(times_s) else []
        if not paths:
            return {}
        stage = prims[0].GetStage()
        moving = [stage.GetPrimAtPath(path) for path in paths]
        world = np.empty((len(paths), len(times_s), 4, 4))
        cache = UsdGeom.XformCache()
        for key, time_s in enumerate(times_s):
            cache.SetTime(Usd.TimeCode(self._start + time_s * self._rate))
            for number, prim in enumerate(moving):
                world[number, key] = _finite(cache.GetLocalToWorldTransform(prim), prim)
        found = {
            path: rigid_track(poses, times_s, prim.GetName(), self.pose)
            for path, poses, prim in zip(paths, world, moving, strict=True)
        }
        self._tracks = {path: track for path, track in found.items() if track is not None}
        return self._tracks


def _finite(matrix: Any, prim: Any) -> Matrix:
    found = np.array(matrix, np.float64).T
    if not np.isfinite(found).all():
        raise SceneError(f"cannot be read: {prim.GetName()}: expected a finite transform")
    plain = affine(found)
    if plain is None:
        raise SceneError(f"cannot be read: {prim.GetName()}: expected a transform without perspective")
    return plain
