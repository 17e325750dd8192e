"""Writer of USD scenes: prims of shapes, the camera, and motion.

The stage has the upward axis of the scene, and lengths as they are. A scene with a mirrored picture lies below a
transform that mirrors all of it, because the format has no mirrored cameras, so that the picture is the same.

Source: OpenUSD documentation, UsdGeom (Mesh, Sphere, Cube, Camera, Xformable) and "Scenegraph Instancing".
"""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from scenes.animation import pose_at
from scenes.arithmetic import determinant, product, tan
from scenes.canonical import (
    Camera,
    Cube,
    Curves,
    Disk,
    Emissive,
    Film,
    Instance,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    Rectangle,
    Scene,
    Sphere,
)
from scenes.canonical.values import Matrix, RigidTrack
from scenes.formats.appearance.media import without_media
from scenes.formats.geometry.conventions import aspect_of
from scenes.formats.geometry.meshed import about_middle, as_mesh, depends_on_uv, rectangle_mesh, shape_name
from scenes.formats.geometry.placing import has_two_sides, keys_from_zero, lose_undrawn_back, shines
from scenes.formats.losses import LossReport, without_settings
from scenes.formats.text.output import Output
from scenes.formats.usd.document import RATE, ROOT, UsdStage, packed
from scenes.formats.usd.write_lights import UsdLightWriter, is_lamp_alone, strengthen
from scenes.formats.usd.write_materials import UsdMaterialWriter
from scenes.models.usd_library import Gf, Sdf, UsdGeom, UsdLux, UsdShade, Vt
from scenes.viewing import up_of

_PROTOTYPES = f"{ROOT}/Prototypes"
_SHORTER_SIDE = 24.0  # of the film, tenths of a scene unit
_NEAR, _FAR = 1e-3, 1e6


class UsdWriter:
    """Writes the prims of a scene."""

    def __init__(self, document: UsdStage, report: LossReport) -> None:
        self.document, self.report, self.stage = document, report, document.stage
        self._materials = UsdMaterialWriter(document, report)
        self._lights = UsdLightWriter(document, report)
        self._counts: Counter[Any] = Counter()
        self._last = 0.0

    def write(self, scene: Scene) -> None:
        """Writes a scene."""
        scene = without_media(scene, self.report)
        if determinant(scene.camera.to_world) < 0.0:
            self.document.place(UsdGeom.Xform.Get(self.stage, ROOT), np.diag([-1.0, 1.0, 1.0, 1.0]))
        self._camera(scene.camera, scene.film)
        keys = list(map(_shared_key, scene.instances))
        self._counts = Counter(keys)
        for number, (instance, key) in enumerate(zip(scene.instances, keys, strict=True)):
            self._instance(
                instance, key, instance.name.rpartition("/")[2] or f"{type(instance.shape).__name__}{number}"
            )
        self.document.place_instances()
        for light in scene.lights:
            self._lights.light(light)
        without_settings(scene, self.report)
        if self._last > 0.0:
            self.stage.SetTimeCodesPerSecond(RATE)
            self.stage.SetStartTimeCode(0.0)
            self.stage.SetEndTimeCode(self._last)

    # --- places ------------------------------------------------------------------------------------------------------

    def _place(self, name: str, matrix: Matrix, track: RigidTrack | None) -> tuple[str, Matrix]:
        """The path of a new prim at a place, below one that moves where it does, and the transform below that."""
        if track is None:
            return self.document.path(name), matrix
        if len(track.translation) == 1:
            return self.document.path(name), product(pose_at(track, track.start_s), matrix)
        mover = self.document.once(("motion", id(track)), track, lambda: self._mover(track))
        return self.document.path(name, mover), matrix

    def _mover(self, track: RigidTrack) -> str:
        """The path of a new transform with the motion of a track; motion begins at the time zero."""
        self.document.place_instances()
        times_s, places, turns = keys_from_zero(track, self.report)
        prim = UsdGeom.Xform.Define(self.stage, self.document.path("motion"))
        move, turn = prim.AddTranslateOp(), prim.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
        for time_s, place, (x, y, z, w) in zip(times_s, places.tolist(), turns.tolist(), strict=True):
            move.Set(Gf.Vec3d(*place), time_s * RATE)
            turn.Set(Gf.Quatd(w, x, y, z), time_s * RATE)
        self._last = max(self._last, times_s[-1] * RATE)
        return str(prim.GetPath())

    # --- cameras -----------------------------------------------------------------------------------------------------

    def _camera(self, camera: Camera, film: Film) -> None:
        wide, high = (_SHORTER_SIDE * side for side in aspect_of(film))
        path, matrix = self._place("camera", camera.to_world, getattr(camera, "track", None))
        made = UsdGeom.Camera.Define(self.stage, path)
        self.document.place(made, matrix)
        if isinstance(camera, OrthographicCamera):
            made.CreateProjectionAttr("orthographic")
            wide, high = (20.0 * camera.half_width * side / _SHORTER_SIDE for side in (wide, high))
        else:
            if not isinstance(camera, PerspectiveCamera):
                self.report.add("camera", type(camera).__name__, "a pinhole of 45 degrees")
                camera = PerspectiveCamera(camera.to_world)
            focal = _SHORTER_SIDE / (2.0 * float(tan(math.radians(camera.fov_deg) / 2.0)))
            made.CreateFocalLengthAttr(focal)
            if camera.shift != (0.0, 0.0):
                made.CreateHorizontalApertureOffsetAttr(camera.shift[0] * wide)
                made.CreateVerticalApertureOffsetAttr(camera.shift[1] * high)
            if camera.lens_radius > 0.0:
                made.CreateFStopAttr(0.1 * focal / (2.0 * camera.lens_radius))
                made.CreateFocusDistanceAttr(camera.focal_distance)
            if camera.shutter_s != (0.0, 0.0):
                self.stage.SetTimeCodesPerSecond(RATE)
                made.CreateShutterOpenAttr(camera.shutter_s[0] * RATE)
                made.CreateShutterCloseAttr(camera.shutter_s[1] * RATE)
        made.CreateHorizontalApertureAttr(wide)
        made.CreateVerticalApertureAttr(high)
        made.CreateClippingRangeAttr((_NEAR, _FAR))

    # --- shapes ------------------------------------------------------------------------------------------------------

    def _instance(self, instance: Instance, key: Any, name: str) -> None:
        if key is None or self._counts[key] == 1:
            self.document.place_instances()  # in the order of the scene
        if key is None:
            path, matrix = self._place(name, instance.to_world, instance.track)
            self._lights.lamp(instance, path, matrix)
            return
        lose_undrawn_back(instance, name, self.report)
        if self._counts[key] == 1:
            path, matrix = self._place(name, instance.to_world, instance.track)
            self._shape(instance, path, matrix, name)
            return
        prototype = self.document.once(
            ("prototype", key), (instance.shape, instance.material), lambda: self._prototype(instance, name)
        )
        path, matrix = self._place(name, instance.to_world, instance.track)
        self.document.instance(path, prototype, matrix)

    def _prototype(self, instance: Instance, name: str) -> str:
        """The path of a class that instances share."""
        self.document.once("prototypes", None, lambda: self.stage.CreateClassPrim(_PROTOTYPES))
        path = self.document.path(name, _PROTOTYPES)
        self.stage.CreateClassPrim(path).SetTypeName("Xform")
        self._shape(instance, self.document.path(name, path), np.eye(4), name)
        return path

    def _shape(self, instance: Instance, path: str, matrix: Matrix, name: str) -> None:
        """Writes a shape with its material."""
        shape, textured = instance.shape, depends_on_uv(instance.material)
        if isinstance(shape, Sphere) and not textured:
            made = UsdGeom.Sphere.Define(self.stage, path)
            made.CreateRadiusAttr(shape.radius)
            made.CreateExtentAttr([(-shape.radius,) * 3, (shape.radius,) * 3])
        elif isinstance(shape, Cube) and not textured:
            made = UsdGeom.Cube.Define(self.stage, path)
            made.CreateSizeAttr(2.0)
        elif isinstance(shape, Curves) and not textured:
            made = self._curves(shape, path, name)
        else:
            if isinstance(shape, Disk | Sphere | Curves):
                became = f"a mesh of {len(as_mesh(shape).faces)} triangles"
                self.report.add(name, shape_name(shape), became)
            mesh = rectangle_mesh() if isinstance(shape, Rectangle) else as_mesh(shape)
            made, middle = self._mesh(mesh, path, textured)
            matrix = matrix if middle is None else product(matrix, middle)
        self.document.place(made, matrix)
        if has_two_sides(instance):
            made.CreateDoubleSidedAttr(True)
        emission = instance.emission if not isinstance(instance.material, Emissive) else None
        material = self._materials.material(instance.material, emission, name)
        UsdShade.MaterialBindingAPI.Apply(made.GetPrim()).Bind(material)
        if shines(instance):
            self._shine(made.GetPrim())

    def _curves(self, curves: Curves, path: str, name: str) -> Any:
        """Curves with their widths; those without normals are round in USD."""
        if curves.kind in ("flat", "cylinder"):
            self.report.add(name, f"curves of the kind {curves.kind!r}, which face the viewer", "round curves")
        made = UsdGeom.BasisCurves.Define(self.stage, path)
        made.CreateTypeAttr("linear" if curves.basis == "linear" else "cubic")
        if curves.basis != "linear":
            made.CreateBasisAttr(curves.basis)
        made.CreateWrapAttr("nonperiodic")
        made.CreateCurveVertexCountsAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(curves.counts, np.int32)))
        made.CreatePointsAttr(self.document.vectors(curves.points, f"points of {path}"))
        made.CreateWidthsAttr(Vt.FloatArray.FromNumpy(np.ascontiguousarray(curves.widths, np.float32)))
        made.SetWidthsInterpolation("vertex")
        wide = 0.5 * float(curves.widths.max())
        ends = np.stack([curves.points.min(axis=0) - wide, curves.points.max(axis=0) + wide])
        made.CreateExtentAttr(self.document.vectors(ends, f"extent of {path}"))
        if curves.normals is not None:
            made.CreateNormalsAttr(self.document.vectors(curves.normals, f"normals of {path}"))
            made.SetNormalsInterpolation("varying")
        return made

    def _shine(self, prim: Any) -> None:
        """Makes a light of a shape whose material shines."""
        if prim.IsA(UsdGeom.Mesh):
            UsdLux.MeshLightAPI.Apply(prim)
        else:
            UsdLux.LightAPI.Apply(prim)
        strengthen(prim, (1.0, 1.0, 1.0))
        UsdLux.LightAPI(prim).CreateMaterialSyncModeAttr("materialGlowTintsLight")

    def _mesh(self, mesh: Mesh, path: str, textured: bool) -> tuple[Any, Matrix | None]:
        """A mesh, and the place of its origin if that was moved."""
        points, middle = about_middle(mesh)
        made = UsdGeom.Mesh.Define(self.stage, path)
        vectors = self.document.vectors
        made.CreatePointsAttr(vectors(points, f"vertices of {path}"))
        made.CreateExtentAttr(vectors(np.stack([points.min(axis=0), points.max(axis=0)]), f"the size of {path}"))
        made.CreateFaceVertexCountsAttr(Vt.IntArray(len(mesh.faces), 3))
        made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(mesh.faces.ravel(), np.int32)))
        made.CreateSubdivisionSchemeAttr("none")
        if mesh.normals is not None:
            made.CreateNormalsAttr(vectors(mesh.normals, f"normals of {path}"))
            made.SetNormalsInterpolation("vertex")
        if textured and mesh.uvs is not None:
            kinds = Sdf.ValueTypeNames.TexCoord2fArray, "vertex"
            UsdGeom.PrimvarsAPI(made).CreatePrimvar("st", *kinds).Set(
                vectors(mesh.uvs, f"texture coordinates of {path}", "Vec2fArray")
            )
        return made, middle


def _shared_key(instance: Instance) -> Any:
    """A key that is equal for instances that share all but their place; None for lamps of UsdLux."""
    if is_lamp_alone(instance):
        return None
    shape = id(instance.shape) if isinstance(instance.shape, Mesh) else instance.shape
    return shape, id(instance.material), instance.emission, has_two_sides(instance)


def save_usd(scene: Scene, output: Output, report: LossReport) -> None:
    """Writes a scene and its files; they are not in place before the output is placed.

    Raises:
        SceneError: it has numbers that are not finite.
    """
    if output.path.suffix.lower() != ".usdz":
        _write(scene, output, output.path, report)
        return
    with TemporaryDirectory() as folder:
        inner = Output(Path(folder) / f"{output.path.stem}.usdc")
        try:
            _write(scene, inner, output.path, report)
            inner.place()
        finally:
            inner.discard()
        files = sorted((path for path in Path(folder).rglob("*") if path.is_file()), key=lambda one: one != inner.path)
        packed(output, [(path.relative_to(folder).as_posix(), path.read_bytes()) for path in files])


def _write(scene: Scene, output: Output, target: Path, report: LossReport) -> None:
    document = UsdStage(output, target, up_of(scene).upper())
    UsdWriter(document, report).write(scene)
    document.write()
