"""The prims of a USD stage that are drawn, and the instances of point instancers.

Source: OpenUSD documentation, UsdGeomPointInstancer.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from scenes.canonical import Matrix, SceneError
from scenes.formats.losses import LossReport
from scenes.models.usd_library import Usd, UsdGeom, UsdLux
from scenes.models.usd_motion import UsdMotion

INSTANCES_MOST = 1 << 20
_HOLDERS = UsdGeom.PointInstancer, UsdGeom.Camera
_DEPTH_MAX = 32
_AMONG = Usd.PrimIsActive & Usd.PrimIsLoaded  # prototypes may lie below a class, or an override alone
Inner = list[tuple[Any, Matrix]]


def prims_of(root: Any, among: Any, motion: UsdMotion, within: bool = True) -> Iterator[Any]:
    """Visible prims at and below a root that hold something, within instances too; those below a point instancer
    are its prototypes. Without ``within`` instances are given in place of what is within them."""
    walk = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(among) if within else among))
    for prim in walk:
        if prim.IsPseudoRoot():
            continue
        imageable = UsdGeom.Imageable(prim)
        if not imageable:
            continue
        visible = imageable.GetVisibilityAttr()
        if visible.HasAuthoredValue():
            if visible.ValueMightBeTimeVarying():
                motion.pose.add(prim.GetName(), "an animation of the visibility", "that")
            if visible.Get(motion.code) == UsdGeom.Tokens.invisible:
                walk.PruneChildren()
                continue
        if not within and prim.IsInstance():
            yield prim
            continue
        if imageable.ComputePurpose() in (UsdGeom.Tokens.proxy, UsdGeom.Tokens.guide):
            continue
        if prim.IsA(UsdGeom.PointInstancer):
            walk.PruneChildren()
        if prim.IsA(UsdGeom.Gprim) or prim.HasAPI(UsdLux.LightAPI) or any(prim.IsA(kind) for kind in _HOLDERS):
            yield prim


class PointInstances:
    """The instances of a stage; those of each instancer are found once.

    Args:
        stage: stage.
        motion: transforms of its prims.
        report: receives losses.
    """

    def __init__(self, stage: Any, motion: UsdMotion, report: LossReport) -> None:
        self.stage, self.motion, self.report = stage, motion, report
        self._found: dict[str, list[tuple[Matrix, Inner]]] = {}
        self._counts: dict[str, int] = {}
        self._admitted = 0

    def admit(self, prim: Any) -> None:
        """Counts a prim with all its instances, before they are made.

        Raises:
            SceneError: there are too many in the file.
        """
        self._admitted += 1 + (self._count(prim, 0) if prim.IsA(UsdGeom.PointInstancer) else 0)
        if self._admitted > INSTANCES_MOST:
            raise SceneError(f"cannot be read: expected at most {INSTANCES_MOST:,} instances")

    def _count(self, prim: Any, depth: int) -> int:
        """Number of prims that an instancer places, with those of instancers among them."""
        if depth > _DEPTH_MAX:
            raise SceneError(f"cannot be read: expected point instancers at most {_DEPTH_MAX} deep")
        key = str(prim.GetPath())
        if key not in self._counts:
            self._counts[key] = sum(
                1 + (self._count(one, depth + 1) if one.IsA(UsdGeom.PointInstancer) else 0)
                for _, inner in self.of(prim)
                for one, _ in inner
            )
        return self._counts[key]

    def of(self, prim: Any) -> list[tuple[Matrix, Inner]]:
        """The pose of each instance of an instancer, and the prims of its prototype with their poses in it.

        Raises:
            SceneError: poses are not finite, or their number or that of the prototypes does not fit.
        """
        key = str(prim.GetPath())
        if key not in self._found:
            self._found[key] = self._read(UsdGeom.PointInstancer(prim), prim)
        return self._found[key]

    def _read(self, given: Any, prim: Any) -> list[tuple[Matrix, Inner]]:
        name, code, made = prim.GetName(), self.motion.code, []
        placing = "Positions", "Orientations", "Scales", "ProtoIndices", "InvisibleIds"
        if any(getattr(given, f"Get{one}Attr")().ValueMightBeTimeVarying() for one in placing):
            self.motion.pose.add(name, "instances that move", "their poses")
        colors = UsdGeom.PrimvarsAPI(prim).GetPrimvar("displayColor")
        if colors and colors.HasValue() and colors.GetInterpolation() != UsdGeom.Tokens.constant:
            self.report.add(name, "colours of single instances")
        paths = given.GetPrototypesRel().GetForwardedTargets()
        chosen = np.array(given.GetProtoIndicesAttr().Get(code) or [], np.int64)
        kinds = given.ExcludeProtoXform, given.IgnoreMask
        poses = np.array(given.ComputeInstanceTransformsAtTime(code, code, *kinds), np.float64).reshape(-1, 4, 4)
        if len(poses) != len(chosen) or (len(chosen) and not 0 <= chosen.min() <= chosen.max() < len(paths)):
            what = f"a pose and one of {len(paths)} prototypes for each instance"
            raise SceneError(f"cannot be read: {name}: expected {what}")
        if len(poses) > INSTANCES_MOST or not np.isfinite(poses).all():
            raise SceneError(f"cannot be read: {name}: expected at most {INSTANCES_MOST:,} finite poses")
        mask = given.ComputeMaskAtTime(code)
        for number, path in enumerate(paths):
            root = self.stage.GetPrimAtPath(path)
            if not root:
                self.report.add(name, f"a prototype {path}, which is not there")
                continue
            inner = [(one, self.motion.matrix_below(one, root)) for one in prims_of(root, _AMONG, self.motion)]
            if any(self.motion.mover(one).startswith(str(root.GetPath())) for one, _ in inner):
                self.motion.pose.add(name, f"motion within the prototype {root.GetName()}")
            at = np.flatnonzero(chosen == number)
            made += [(poses[one].T, inner) for one in (at[np.array(mask, bool)[at]] if len(mask) else at)]
        return made
