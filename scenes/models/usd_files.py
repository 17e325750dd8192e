"""Reader of USD: the imageable prims of a stage, with their rigid motion.

Coordinates are those of the file, whatever ``metersPerUnit`` is: nothing in a picture depends on the unit.

Source: OpenUSD documentation, UsdGeom (Imageable, Xformable, PointInstancer), UsdShade, UsdSkel.
"""

from __future__ import annotations

import re
from collections.abc import Hashable
from typing import Any

import numpy as np

from scenes.arithmetic import determinant, product
from scenes.canonical import Instance, Light, Material, Matrix, Mesh, RigidTrack, SceneError
from scenes.canonical.values import vertices_of
from scenes.formats.losses import LossReport
from scenes.loading import state_of
from scenes.models.gltf_materials import GltfMaterials
from scenes.models.model import Model, ModelCamera
from scenes.models.motion import Pose
from scenes.models.smoothing import unit_normals, with_corners
from scenes.models.sources import Sources
from scenes.models.usd_curves import curves_of
from scenes.models.usd_instances import PointInstances
from scenes.models.usd_library import Gf, Tf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel, UsdUtils
from scenes.models.usd_losses import lose_settings, lose_unread
from scenes.models.usd_materials import UsdMaterials
from scenes.models.usd_meshes import (
    Triangles,
    normals_at_corners,
    primvar_at_corners,
    subsets_of,
    triangles_of,
)
from scenes.models.usd_motion import UsdMotion
from scenes.models.usd_repeats import Repeat, Repeats
from scenes.models.usd_shapes import KINDS as SHAPES
from scenes.models.usd_shapes import shapes_of
from scenes.models.usd_text import refuse_nested
from scenes.models.usd_textures import Pictures, UsdDocument, UsdTextures
from scenes.models.usd_values import finite, note_animated
from scenes.models.usd_views import LAMP, camera_of, glow_of, light_of

_GREY = 0.18
_ADDRESS = re.compile(r"anon:0x[0-9a-fA-F]+:?")
_RULE = re.compile(r" matching pxrInternal.*?(?= at ')")  # of OpenUSD's grammar
_SAID_MOST = 200  # characters of a message, which may quote the rest of the file
_Part = tuple[Any, Material, Matrix]


def read_usd(sources: Sources, report: LossReport, facets: bool = False, time_s: float = 0.0) -> Model:
    """The stage of a file: its meshes, primitives and instances, lights and cameras.

    Prims that are invisible, or proxies or guides, are left out. Skeletons, and all values that change over time
    beside transforms, are as at ``time_s``, seconds since the start of the stage.

    Raises:
        SceneError: the file cannot be read.
    """
    refuse_nested(sources)
    quiet = UsdUtils.CoalescingDiagnosticDelegate()  # its messages would go to standard error
    try:
        stage = Usd.Stage.Open(str(sources.path))
        for layer in stage.GetUsedLayers():
            if layer.realPath:
                path = sources.path.parent / layer.realPath
                sources.files.setdefault(path, state_of(path))
        for error in sorted(_ADDRESS.sub("", str(error)) for error in stage.GetCompositionErrors()):
            report.add(sources.path.stem, " ".join(error.split())[:_SAID_MOST])
        return _Reader(stage, sources, report, facets, time_s).model()
    except Tf.ErrorException as error:
        said = _RULE.sub("", " ".join(str(error.args[0].commentary).split()))
        raise SceneError(f"cannot be read: {said.removeprefix(f'{sources.path}:')[:_SAID_MOST]}") from None
    finally:
        quiet.TakeCoalescedDiagnostics()
        del quiet


class _Reader:
    """Reads the prims of a stage, each mesh once."""

    def __init__(self, stage: Any, sources: Sources, report: LossReport, facets: bool, time_s: float) -> None:
        self.stage, self.sources, self.report = stage, sources, report
        self.motion = UsdMotion(stage, Pose(time_s, report))
        self.code = self.motion.code
        document = UsdDocument(sources)
        self.pictures = sources.kept = sources.kept or Pictures(sources)
        self.described = UsdMaterials(document, self.pictures, self.motion, report)
        self.materials = GltfMaterials(document, UsdTextures(document, report), report, facets)
        self.instances = PointInstances(stage, self.motion, report)
        self.up_is_z = UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
        self._stem = sources.path.stem
        self._materials: dict[Any, Any] = {}
        self._made: dict[Hashable, tuple[list[_Part], bool]] = {}
        self._parts: list[Instance] = []
        self._lights: list[Light] = []
        self._cameras: dict[str, ModelCamera] = {}

    def model(self) -> Model:
        self._bend()
        lose_settings(self.stage, self.report)
        shown, alike = Repeats(self.motion).walk(self.stage.GetPseudoRoot())
        plain = [prim for number, prim in enumerate(shown) if number not in alike]
        tracks = self.motion.tracks(plain)
        bound = UsdShade.MaterialBindingAPI.ComputeBoundMaterials(plain)[0]
        self._materials = {prim.GetPath(): material for prim, material in zip(plain, bound, strict=True)}
        places = iter(self.motion.matrices([shown[number] for number in alike]))
        for number, prim in enumerate(shown):
            if number in alike:
                self._repeat(alike[number], next(places))
            else:
                self.instances.admit(prim)
                self._add(prim, self.motion.matrix(prim), tracks.get(self.motion.mover(prim)))
        up = "z" if self.up_is_z else "y"
        return Model(tuple(self._parts), tuple(self._lights), self._cameras, up, self.motion.pose.counts)

    def _bend(self) -> None:
        """Moves points of skinned meshes to the pose of their skeletons, in memory alone."""
        roots = [prim for prim in self.stage.Traverse() if prim.IsA(UsdSkel.Root)]
        if not roots:
            return
        self.stage.SetEditTarget(self.stage.GetSessionLayer())
        at = self.code.GetValue()
        for root in roots:
            animations = [prim for prim in Usd.PrimRange(root) if prim.IsA(UsdSkel.Animation)]
            moving = [one for prim in animations for one in prim.GetAttributes() if one.ValueMightBeTimeVarying()]
            if moving:
                self.motion.pose.add(root.GetName(), "a skeleton that moves")
            for attribute in moving:  # baking takes samples as they are, and does not interpolate
                attribute.Set(attribute.Get(self.code), self.code)
            UsdSkel.BakeSkinning(UsdSkel.Root(root), Gf.Interval(at, at))

    def _add(self, prim: Any, matrix: Matrix, track: RigidTrack | None) -> None:
        """Adds what a prim itself holds."""
        if prim.IsA(UsdGeom.Gprim):
            if not self._flat(prim, matrix, "a node"):
                self._put(prim, *self._shapes(prim), matrix, track)
            return
        lose_unread(prim, self.report)
        if prim.IsA(UsdGeom.PointInstancer):
            self._instances(prim, matrix, track)
        elif prim.IsA(UsdGeom.Camera):
            key = prim.GetName() if prim.GetName() not in self._cameras else str(prim.GetPath())
            note_animated(prim, self.motion.pose)
            self._cameras[key] = camera_of(prim, self.code, matrix, track, self.report)
        elif prim.HasAPI(UsdLux.LightAPI):
            self._light(prim, matrix, track)

    def _flat(self, prim: Any, matrix: Matrix, what: str) -> bool:
        """Whether a transform has no extent, which is a loss."""
        if determinant(matrix[:3, :3]) != 0.0:
            return False
        self.report.add(prim.GetName(), f"{what} without extent")
        return True

    def _put(self, prim: Any, parts: list[_Part], both: bool, matrix: Matrix, track: RigidTrack | None) -> None:
        """Adds the shapes of a prim, which have ``both`` sides or one."""
        name = self._name(prim)
        for shape, material, local in parts:
            place = product(matrix, local)
            self._parts.append(Instance(shape, material, place, track, name, emission_twosided=both))

    def _name(self, prim: Any) -> str:
        return f"{self._stem}/{prim.GetName()}"

    def _repeat(self, repeat: Repeat, matrix: Matrix) -> None:
        """Adds an instance that is like an earlier one."""
        if repeat.parts is None:
            repeat.parts = []
            for prim, place in zip(repeat.inner, repeat.places, strict=True):
                found, both = self._shapes(prim)
                repeat.parts.append(([(shape, stuff, product(place, local)) for shape, stuff, local in found], both))
        for prim, (parts, both) in zip(repeat.inner, repeat.parts, strict=True):
            self.instances.admit(prim)
            if not self._flat(prim, matrix, "a node"):
                self._put(prim, parts, both, matrix, None)

    def _light(self, prim: Any, matrix: Matrix, track: RigidTrack | None) -> None:
        if self._flat(prim, matrix, "a light"):
            return
        note_animated(prim, self.motion.pose)
        light, lamp = light_of(prim, self.code, matrix, self.pictures, self.up_is_z, self.report)
        if light is not None:
            self._lights.append(light)
            if track is not None:
                self.motion.pose.add(prim.GetName(), "a moving light")
        elif lamp is not None:
            shape, place, radiance = lamp
            self._parts.append(Instance(shape, LAMP, place, track, self._name(prim), radiance))

    def _instances(self, prim: Any, matrix: Matrix, track: RigidTrack | None) -> None:
        """Adds the instances of a point instancer."""
        for pose, inner in self.instances.of(prim):
            place = product(matrix, pose)
            for one, local in inner:
                self._add(one, product(place, local), track)

    def _shapes(self, prim: Any) -> tuple[list[_Part], bool]:
        """Shapes of a prim with their materials, in its space, and whether they have both sides.

        Instances of one prototype share them if they inherit the same materials and primvars.
        """
        key: tuple[Hashable, ...] = (str(prim.GetPath()),)
        if prim.IsInstanceProxy():
            bound = [self._bound(one) for one in (prim, *prim.GetChildren())]
            primvars = UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
            key = _shared(prim), *(_shared(material.GetPrim()) if material else "" for material in bound)
            key += tuple(sorted((one.GetName(), _shared(one.GetAttr().GetPrim())) for one in primvars))
        if key not in self._made:
            lose_unread(prim, self.report)
            self._made[key] = self._read(prim), bool(UsdGeom.Gprim(prim).GetDoubleSidedAttr().Get())
        return self._made[key]

    def _read(self, prim: Any) -> list[_Part]:
        name, kind = prim.GetName(), prim.GetTypeName()
        if not prim.IsA(UsdGeom.Mesh) and kind not in (*SHAPES, "BasisCurves"):
            self.report.add(name, f"a prim of kind {kind}")
            return []
        note_animated(prim, self.motion.pose)
        if prim.HasAPI(UsdLux.LightAPI) and not glow_of(prim, self.code, self.report):
            self.report.add(name, "the light of a mesh", "a surface that does not shine")
        opacity = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayOpacity")
        if opacity and opacity.HasValue() and self._bound(prim) is None:
            self.report.add(name, "an opacity without a material", "opaque")
        if prim.IsA(UsdGeom.Mesh):
            return self._mesh(UsdGeom.Mesh(prim), name)
        if kind == "BasisCurves":
            curves = curves_of(prim, self.code, name, self.report)
            if curves is None:
                return []
            shapes = [(curves, np.eye(4))]
        else:
            shapes = shapes_of(prim, self.code)
        number, colors = self.described.number(self._bound(prim), bool(UsdGeom.Gprim(prim).GetDoubleSidedAttr().Get()))
        if self.described.coordinates(number):
            self.report.add(name, f"textures of a {kind.lower()}, which has no texture coordinates")
        color = None
        if colors:
            shown = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(colors)
            found = shown.ComputeFlattened(self.code) if shown and shown.HasValue() else None
            color = finite(_GREY if not found else np.array(found[0], np.float64), f"{name}: primvar {colors}")
            color = np.broadcast_to(color, (1, 3, 3))
        material = self.materials.painted(number, {}, color).material
        return [(shape, material, local) for shape, local in shapes]

    def _mesh(self, mesh: Any, name: str) -> list[_Part]:
        """The parts of a mesh, one for each material."""
        whole = triangles_of(mesh, self.code, name, self.report)
        if whole is None:
            return []
        rest, found = np.ones(whole.polygons, bool), []
        for prim, marks in subsets_of(mesh, self.code, whole.polygons, self.report):
            note_animated(prim, self.motion.pose)
            found.append((prim, marks & rest))
            rest &= ~marks
        found.append((mesh.GetPrim(), rest))
        made = []
        for prim, marks in found:
            kept = marks[whole.polygon]
            if kept.any():
                part = self._part(mesh, whole.of(kept), self._bound(prim) or self._bound(mesh.GetPrim()), name)
                made.append((*part, np.eye(4)))
        return made

    def _part(self, mesh: Any, triangles: Triangles, bound: Any, name: str) -> tuple[Mesh, Material]:
        prim, source = mesh.GetPrim(), str(self.sources.path)
        number, shown = self.described.number(bound, bool(mesh.GetDoubleSidedAttr().Get()))
        sets = {}
        for index, primvar in self.described.coordinates(number).items():
            values = primvar_at_corners(prim, primvar, 2, triangles, self.code, name, self.report)
            if values is not None:
                sets[index] = values * (1.0, -1.0)
        colors = primvar_at_corners(prim, shown, 3, triangles, self.code, name, self.report) if shown else None
        if shown and colors is None:
            colors = np.full((1, 3, 3), _GREY)
        painted = self.materials.painted(number, sets, colors)
        normals = normals_at_corners(mesh, triangles, self.code, name, self.report)
        corners = triangles.points[triangles.at]
        if normals is None and painted.uvs is None:
            used, place = np.unique(triangles.at, return_inverse=True)
            points = vertices_of(triangles.points[used])
            return Mesh(points, place.reshape(-1, 3).astype(np.int32), source=source), painted.material
        shading = None if normals is None else unit_normals(normals, corners)
        return with_corners(corners, shading, painted.uvs, source), painted.material

    def _bound(self, prim: Any) -> Any:
        """The material that is bound to a prim; None without one."""
        found = self._materials.get(prim.GetPath())
        found = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0] if found is None else found
        return found or None


def _shared(prim: Any) -> str:
    """The path of a prim, in its prototype if it is one of an instance."""
    return str((prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath())
