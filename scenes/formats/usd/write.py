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
from scenes.formats.geometry.bodies import Body, bodies_of, joined
from scenes.formats.geometry.conventions import aspect_of
from scenes.formats.geometry.meshed import as_mesh, depends_on_uv, of_radius_one, rectangle_mesh, shape_name
from scenes.formats.geometry.placing import has_two_sides, keys_from_zero, lose_undrawn_back, shines
from scenes.formats.losses import LossReport, without_settings
from scenes.formats.text.output import Output
from scenes.formats.usd.document import RATE, ROOT, UsdStage, packed
from scenes.formats.usd.write_lights import UsdLightWriter, is_lamp_alone, strengthen
from scenes.formats.usd.write_materials import UsdMaterialWriter
from scenes.formats.usd.write_shapes import material_prims, write_curves, write_mesh
from scenes.models.usd_library import Gf, UsdGeom, UsdLux, UsdShade
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
        bodies = list(bodies_of(map(_sized, scene.instances), _alike))
        keys = list(map(_shared_key, bodies))
        self._counts = Counter(keys)
        number = 0
        for body, key in zip(bodies, keys, strict=True):
            self._body(body, key, body[0].name.rpartition("/")[2] or f"{type(body[0].shape).__name__}{number}")
            number += len(body)
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

    def _body(self, body: Body, key: Any, name: str) -> None:
        """Writes an instance, or the parts of one mesh."""
        at = body[0]
        if key is None or self._counts[key] == 1:
            self.document.place_instances()  # in the order of the scene
        if key is None:
            path, matrix = self._place(name, at.to_world, at.track)
            self._lights.lamp(at, path, matrix)
            return
        for part in body:
            lose_undrawn_back(part, name, self.report)
        if self._counts[key] == 1:
            path, matrix = self._place(name, at.to_world, at.track)
            self._shape(body, path, matrix, name)
            return
        kept = [(part.shape, part.material) for part in body]
        prototype = self.document.once(("prototype", key), kept, lambda: self._prototype(body, name))
        path, matrix = self._place(name, at.to_world, at.track)
        self.document.instance(path, prototype, matrix)

    def _prototype(self, body: Body, name: str) -> str:
        """The path of a class that instances share."""
        self.document.once("prototypes", None, lambda: self.stage.CreateClassPrim(_PROTOTYPES))
        path = self.document.path(name, _PROTOTYPES)
        self.stage.CreateClassPrim(path).SetTypeName("Xform")
        self._shape(body, self.document.path(name, path), np.eye(4), name)
        return path

    def _shape(self, body: Body, path: str, matrix: Matrix, name: str) -> None:
        """Writes a shape with its material, or a mesh with a material for each part."""
        instance = body[0]
        shape, textured = instance.shape, depends_on_uv(instance.material)
        if isinstance(shape, Sphere) and not textured:
            made = UsdGeom.Sphere.Define(self.stage, path)
            made.CreateRadiusAttr(shape.radius)
            made.CreateExtentAttr([(-shape.radius,) * 3, (shape.radius,) * 3])
        elif isinstance(shape, Cube) and not textured:
            made = UsdGeom.Cube.Define(self.stage, path)
            made.CreateSizeAttr(2.0)
        elif isinstance(shape, Curves) and not textured:
            made = write_curves(self.document, shape, path, name, self.report)
        else:
            if isinstance(shape, Disk | Sphere | Curves):
                became = f"a mesh of {len(as_mesh(shape).faces)} triangles"
                self.report.add(name, shape_name(shape), became)
            mesh = rectangle_mesh() if isinstance(shape, Rectangle) else as_mesh(shape)
            if len(body) > 1:
                mesh, textured = joined(body), True
            made, middle = write_mesh(self.document, mesh, path, textured)
            matrix = matrix if middle is None else product(matrix, middle)
        self.document.place(made, matrix)
        if has_two_sides(instance):
            made.CreateDoubleSidedAttr(True)
        for part, prim in zip(body, material_prims(made, body), strict=True):
            emission = part.emission if not isinstance(part.material, Emissive) else None
            material = self._materials.material(part.material, emission, name)
            UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)
        if shines(instance):
            self._shine(made.GetPrim())

    def _shine(self, prim: Any) -> None:
        """Makes a light of a shape whose material shines."""
        if prim.IsA(UsdGeom.Mesh):
            UsdLux.MeshLightAPI.Apply(prim)
        else:
            UsdLux.LightAPI.Apply(prim)
        strengthen(prim, (1.0, 1.0, 1.0))
        UsdLux.LightAPI(prim).CreateMaterialSyncModeAttr("materialGlowTintsLight")


def _sized(instance: Instance) -> Instance:
    """The instance; one that becomes a mesh has the radius 1."""
    shape = instance.shape
    meshed = isinstance(shape, Disk) or (isinstance(shape, Sphere) and depends_on_uv(instance.material))
    return of_radius_one(instance) if meshed and not is_lamp_alone(instance) else instance


def _alike(first: Instance, second: Instance) -> bool:
    """Whether one mesh can have both meshes as parts."""
    normals = [isinstance(one.shape, Mesh) and one.shape.normals is not None for one in (first, second)]
    sides = has_two_sides(first) == has_two_sides(second)
    return sides and normals[0] == normals[1] and not (shines(first) or shines(second))


def _shared_key(body: Body) -> Any:
    """A key that is equal for bodies that share all but their place; None for lamps of UsdLux."""
    if is_lamp_alone(body[0]):
        return None
    return tuple(
        (
            id(one.shape) if isinstance(one.shape, Mesh) else one.shape,
            id(one.material),
            one.emission,
            has_two_sides(one),
        )
        for one in body
    )


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
