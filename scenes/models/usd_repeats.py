"""Instances of a USD stage that differ from an earlier one in their place alone."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

from scenes.arithmetic import determinant
from scenes.canonical import Material, Matrix, Shape
from scenes.models.usd_instances import prims_of
from scenes.models.usd_library import Usd, UsdGeom, UsdShade
from scenes.models.usd_motion import UsdMotion

_PLACED = ("xformOp:", "xformOpOrder")
_BINDING = "material:binding"


@dataclass
class Repeat:
    """What like instances hold.

    Attributes:
        inner: prims within the first of them.
        places: transforms from these to the instance.
        parts: for each of them its shapes with materials and transforms to the instance, and whether they have both
            sides; None until they are read.
    """

    inner: list[Any]
    places: list[Matrix]
    parts: list[tuple[list[tuple[Shape, Material, Matrix]], bool]] | None = None


class Repeats:
    """Finds instances that are alike: those of one prototype and one parent, with the same material of their own.

    What they inherit beside it they have from their parent. Those with further properties of their own, below prims
    that bind materials to collections, with anything but shapes in them, or in a stage that moves, are like no other.
    """

    def __init__(self, motion: UsdMotion) -> None:
        self.motion = motion
        self._collections: dict[str, bool] = {}

    def walk(self, root: Any) -> tuple[list[Any], dict[int, Repeat]]:
        """Visible prims below a root, among them each instance that is like an earlier one in place of what is within
        it; these by their indices, with what they hold."""
        shown: list[Any] = []
        alike: dict[int, Repeat] = {}
        known: dict[Hashable, Repeat | None] = {}
        for prim in prims_of(root, Usd.PrimDefaultPredicate, self.motion, within=False):
            if not prim.IsInstance():
                shown.append(prim)
                continue
            key = self._likeness(prim)
            found = known.get(key) if key is not None else None
            if found is not None:
                alike[len(shown)] = found
                shown.append(prim)
                continue
            inner = list(prims_of(prim, Usd.PrimDefaultPredicate, self.motion))
            shown += inner
            if key is not None and key not in known:
                places = self._places(prim, inner)
                known[key] = None if places is None else Repeat(inner, places)
        return shown, alike

    def _likeness(self, prim: Any) -> Hashable | None:
        """A key that like instances share; None for an instance that is like no other."""
        if self.motion.moves:
            return None
        names = [name for name in prim.GetAuthoredPropertyNames() if not name.startswith(_PLACED)]
        if names not in ([], [_BINDING]) or self._below_collections(prim.GetParent()):
            return None
        bound: Hashable = ()
        if names:
            relation = prim.GetRelationship(_BINDING)
            strength = UsdShade.MaterialBindingAPI.GetMaterialBindingStrength(relation)
            bound = tuple(map(str, relation.GetTargets())), str(strength)
        return str(prim.GetPrototype().GetPath()), str(prim.GetParent().GetPath()), bound

    def _below_collections(self, prim: Any) -> bool:
        """Whether a prim, or one above it, binds materials to collections."""
        path = str(prim.GetPath())
        if path not in self._collections:
            names = () if prim.IsPseudoRoot() else prim.GetAuthoredPropertyNames()
            here = any(name.startswith(f"{_BINDING}:collection") for name in names)
            self._collections[path] = here or (not prim.IsPseudoRoot() and self._below_collections(prim.GetParent()))
        return self._collections[path]

    def _places(self, prim: Any, inner: list[Any]) -> list[Matrix] | None:
        """Transforms from shapes within an instance to its own space; None if it holds anything but shapes with an
        extent that move with it."""
        if prim in inner or not all(one.IsA(UsdGeom.Gprim) for one in inner):
            return None
        found = [self.motion.relative(one, prim) for one in inner]
        places = [one for one in found if one is not None and determinant(one[:3, :3]) != 0.0]
        return places if len(places) == len(found) else None
