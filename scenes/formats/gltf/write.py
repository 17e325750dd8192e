"""Writer of glTF 2.0 scenes: nodes, meshes, cameras, lights and motion.

The world of glTF has y upwards and no mirrored cameras: scenes with z upwards, or with a mirrored picture, lie below
one node that turns or mirrors all of them, so that the picture is the same. Radiant units stand for the photometric
ones of the format, one for one.

Source: Khronos Group, "glTF 2.0 specification"; extension KHR_lights_punctual.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from scenes.animation import pose_at
from scenes.arithmetic import arctan, determinant, product, tan
from scenes.canonical import (
    Camera,
    Curves,
    Disk,
    Emissive,
    EnvironmentLight,
    Film,
    Instance,
    Light,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
    SpotLight,
    SunSky,
)
from scenes.canonical.values import Matrix, Rgb, RigidTrack
from scenes.daylight import sun_light
from scenes.formats.appearance.media import absorbing_within
from scenes.formats.appearance.spot_profiles import reshaped
from scenes.formats.geometry.bodies import Body, bodies_of
from scenes.formats.geometry.conventions import FAR
from scenes.formats.geometry.meshed import (
    about_middle,
    as_mesh,
    depends_on_uv,
    of_radius_one,
    rectangle_mesh,
    shape_name,
)
from scenes.formats.geometry.placing import facing, has_two_sides, keys_from_zero, lose_undrawn_back, shines
from scenes.formats.gltf.document import INDICES, VERTICES, Document, Json
from scenes.formats.gltf.write_materials import GltfMaterialWriter, Look
from scenes.formats.losses import LossReport, without_settings
from scenes.formats.text.output import Output
from scenes.viewing import turned_up

_NEAR, _SHARP_RAD = 1e-3, 1e-6
_LEVEL = 1e-3  # that a camera must be nearer to z upwards, so that a turned scene is not turned again
_SPARSE = np.iinfo(np.uint16).max
_Part = tuple[Mesh, Look]


@dataclass
class GltfWriter:
    """Collects the nodes of a scene."""

    document: Document
    report: LossReport
    _roots: list[int] = field(default_factory=list)
    _channels: list[Json] = field(default_factory=list)
    _samplers: list[Json] = field(default_factory=list)
    _lights: list[Json] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._materials = GltfMaterialWriter(self.document, self.report)

    def write(self, scene: Scene) -> None:
        """Writes a scene."""
        scene = absorbing_within(scene, self.report)
        self._camera(scene.camera, scene.film)
        number = 0
        for body in bodies_of(map(of_radius_one, scene.instances), lambda first, second: True):
            name = body[0].name.rpartition("/")[2] or f"{type(body[0].shape).__name__}{number}"
            self._body(body, name)
            number += len(body)
        for light in scene.lights:
            self._light(light)
        without_settings(scene, self.report)
        roots, turn = self._roots, _turned(scene)
        if not np.array_equal(turn, np.eye(4)):
            roots = [self._node({"name": "world", "children": roots}, turn)]
        self.document.add("scenes", {"name": scene.name or "scene", "nodes": roots})
        if self._lights:
            self.document.extensions |= self.document.extension("KHR_lights_punctual", {"lights": self._lights})
        if self._channels:
            self.document.add("animations", {"channels": self._channels, "samplers": self._samplers})

    def _node(self, values: Json, matrix: Matrix) -> int:
        if not np.array_equal(matrix, np.eye(4)):
            values["matrix"] = [float(value) for value in matrix.T.ravel()]
        return self.document.add("nodes", values)

    def _place(self, values: Json, matrix: Matrix, track: RigidTrack | None = None) -> None:
        """Adds a node at a place, below a node that moves where it does."""
        node = self._node(values, matrix)
        if track is None or len(track.translation) == 1:
            if track is not None:
                node = self._node({"children": [node]}, pose_at(track, track.start_s))
            self._roots.append(node)
            return
        children = self.document.once(("motion", id(track)), track, lambda: self._moving(track))
        children.append(node)

    def _moving(self, track: RigidTrack) -> list[int]:
        """The children of a new node with the motion of a track; times of glTF begin at zero."""
        times_s, places, turns = keys_from_zero(track, self.report)
        children: list[int] = []
        node = self.document.add("nodes", {"name": "motion", "children": children})
        times = self.document.accessor(np.array(times_s, np.float32), bounds=True)
        for path, values in (("translation", places), ("rotation", turns)):
            accessor = self.document.accessor(values.astype(np.float32))
            self._samplers.append({"input": times, "output": accessor, "interpolation": "LINEAR"})
            self._channels.append({"sampler": len(self._samplers) - 1, "target": {"node": node, "path": path}})
        self._roots.append(node)
        return children

    # --- cameras -----------------------------------------------------------------------------------------------------

    def _camera(self, camera: Camera, film: Film) -> None:
        wide, high = (side / min(film.width_px, film.height_px) for side in (film.width_px, film.height_px))
        if isinstance(camera, OrthographicCamera):
            lens: Json = {"xmag": camera.half_width * wide, "ymag": camera.half_width * high}
            made = {"type": "orthographic", "orthographic": {**lens, "znear": 0.0, "zfar": FAR}}
        else:
            if not isinstance(camera, PerspectiveCamera):
                self.report.add("camera", type(camera).__name__, "a pinhole of 45 degrees")
                camera = PerspectiveCamera(camera.to_world)
            self._losses_of(camera)
            fov_rad = 2.0 * float(arctan(high * tan(math.radians(camera.fov_deg) / 2.0)))
            made = {"type": "perspective",
                    "perspective": {"yfov": fov_rad, "aspectRatio": wide / high, "znear": _NEAR}}  # fmt: skip
        number = self.document.add("cameras", made)
        self._place({"name": "camera", "camera": number}, camera.to_world, getattr(camera, "track", None))

    def _losses_of(self, camera: PerspectiveCamera) -> None:
        if camera.lens_radius > 0.0:
            self.report.add("camera", f"a lens of radius {camera.lens_radius:g}", "a pinhole")
        if camera.shift != (0.0, 0.0):
            self.report.add("camera", "a picture off the viewing direction", "one about it")
        if camera.shutter_s[0] != camera.shutter_s[1]:
            self.report.add("camera", "a shutter that is open for some time", "a moment")

    # --- shapes ------------------------------------------------------------------------------------------------------

    def _part(self, instance: Instance, name: str) -> _Part:
        """The mesh and the look of an instance."""
        shape = instance.shape
        lose_undrawn_back(instance, name, self.report)
        if isinstance(shape, Disk | Sphere | Curves):
            became = f"a mesh of {len(as_mesh(shape).faces)} triangles"
            self.report.add(name, shape_name(shape), became)
        mesh = rectangle_mesh() if isinstance(shape, Rectangle) else as_mesh(shape)
        emission = instance.emission if shines(instance) and not isinstance(instance.material, Emissive) else None
        return mesh, Look(instance.material, emission, has_two_sides(instance), instance.interior)

    def _body(self, body: Body, name: str) -> None:
        """Adds a mesh, each of whose parts is a primitive, and its node."""
        parts, at = [self._part(one, name) for one in body], body[0]
        key = "mesh", *((id(mesh), look.key) for mesh, look in parts)
        number, middle = self.document.once(key, parts, lambda: self._mesh(parts, name))
        matrix = at.to_world if middle is None else product(at.to_world, middle)
        self._place({"name": name, "mesh": number}, matrix, at.track)

    def _mesh(self, parts: list[_Part], name: str) -> tuple[int, Matrix | None]:
        """The index of a mesh with its materials, and the place of its origin if that was moved."""
        primitives, middle = [], None
        for mesh, look in parts:
            textured = mesh.uvs is not None and depends_on_uv(look.material)
            make = partial(self._geometry, mesh, textured)
            geometry, middle = self.document.once(("geometry", id(mesh), textured), mesh, make)
            primitives.append({**geometry, "material": self._materials.material(look, name)})
        return self.document.add("meshes", {"name": name, "primitives": primitives}), middle

    def _geometry(self, mesh: Mesh, textured: bool) -> tuple[Json, Matrix | None]:
        """Vertices and faces; the format has floats of 32 bits, so that far vertices are given from their middle."""
        points, middle = about_middle(mesh)
        found = {"POSITION": self.document.accessor(points.astype(np.float32), VERTICES, bounds=True)}
        if mesh.normals is not None:
            found["NORMAL"] = self.document.accessor(mesh.normals.astype(np.float32), VERTICES)
        if textured and mesh.uvs is not None:
            down = np.stack([mesh.uvs[:, 0], 1.0 - mesh.uvs[:, 1]], axis=1)
            found["TEXCOORD_0"] = self.document.accessor(down.astype(np.float32), VERTICES)
        kind = np.uint16 if len(points) <= _SPARSE else np.uint32
        return {
            "attributes": found,
            "indices": self.document.accessor(mesh.faces.ravel().astype(kind), INDICES),
        }, middle

    # --- lights ------------------------------------------------------------------------------------------------------

    def _light(self, light: Light) -> None:
        if isinstance(light, EnvironmentLight):
            self.report.add("light", "light all around")
            return
        if isinstance(light, SunSky):
            if light.part != "sun":
                self.report.add("light", "the sky")
            if light.part == "sky":
                return
            light = sun_light(light)
        if isinstance(light, PointLight):
            place = np.eye(4)
            place[:3, 3] = light.position
            self._punctual("point", light.intensity, place)
        elif isinstance(light, SpotLight):
            light = reshaped(light, "quadratic", self.report)
            if light.outer_deg > 90.0:
                self.report.add("light", f"a spot of {light.outer_deg:g} degrees", "90 degrees")
            outer = math.radians(min(light.outer_deg, 90.0))
            inner = min(math.radians(light.inner_deg), outer - _SHARP_RAD)
            place = facing(np.array(light.position), np.subtract(light.target, light.position))
            cone = {"innerConeAngle": max(inner, 0.0), "outerConeAngle": outer}
            self._punctual("spot", light.intensity, place, spot=cone)
        else:
            if light.angle_deg > 0.0:
                self.report.add("light", f"a sun of {light.angle_deg:g} degrees", "a parallel light")
            self._punctual("directional", light.irradiance, facing(np.zeros(3), np.array(light.direction)))

    def _punctual(self, kind: str, strength: Rgb, place: Matrix, **more: Json) -> None:
        """Adds a light with its node; colours are at most 1."""
        most = max(strength)
        color = [part / most for part in strength] if most > 0.0 else [1.0, 1.0, 1.0]
        self._lights.append({"type": kind, "color": color, "intensity": most, **more})
        node: Json = {"name": kind}
        node["extensions"] = self.document.extension("KHR_lights_punctual", {"light": len(self._lights) - 1})
        self._place(node, place)


def _turned(scene: Scene) -> Matrix:
    """The transform of the world to one with y upwards in which the picture is not mirrored."""
    up = np.abs(scene.camera.to_world[:3, 1])
    turn = turned_up("y") if up[2] > up[1] + _LEVEL else np.eye(4)
    if determinant(scene.camera.to_world) < 0.0:
        turn = product(np.diag([-1.0, 1.0, 1.0, 1.0]), turn)
    return turn


def save_gltf(scene: Scene, output: Output, report: LossReport) -> None:
    """Writes a scene and its files; they are not in place before the output is placed."""
    document = Document(output)
    GltfWriter(document, report).write(scene)
    document.write()
