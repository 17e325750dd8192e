"""Directives of a whole scene, as far as PBRT and LuxRender share them.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from scenes.canonical import (
    Camera,
    EnvironmentCamera,
    Instance,
    Light,
    Medium,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    RealisticCamera,
    Scene,
)
from scenes.formats.appearance.media import media_of
from scenes.formats.directives.surface_writer import SurfaceWriter
from scenes.formats.geometry.conventions import FAR, aspect_of
from scenes.formats.geometry.placing import PartKey, borders_media, lose_back, part_key, shared_parts
from scenes.formats.text.numbers import listed, number

INLINE_MAX = 64
"""Maximum number of triangles of a mesh that is written into the scene file; larger meshes get their own file."""

_ENDLESS = 1000  # bounces that replace an unlimited depth


@dataclass
class SceneWriter(SurfaceWriter):
    """Collects the lines of a scene; a dialect adds settings, lights and shapes.

    Attributes:
        aspect: width and height of the picture in shorter sides.
        shared: parts that are written once as objects.
        media: names of the media.
        medium: medium around the camera.
    """

    aspect: tuple[float, float] = (1.0, 1.0)
    shared: frozenset[PartKey] = frozenset()
    media: dict[Medium, str] = field(default_factory=dict)
    medium: Medium | None = None
    _objects: dict[PartKey, str] = field(default_factory=dict)

    def write(self, scene: Scene) -> None:
        """Writes a scene."""
        self.shared = shared_parts(scene)
        self.aspect = aspect_of(scene.film)
        self.write_settings(scene)
        self._write_media(scene)
        self.write_camera(scene.camera)
        self.lines.append("WorldBegin")
        self._environment_only_seen(scene)
        for name, material in scene.materials.items():
            self.material(material, name)
        for light in scene.lights:
            self.write_light(light)
        for instance in scene.instances:
            lose_back(instance, self.report)
            self.write_instance(instance)
        self.lines.append("WorldEnd")

    def _write_media(self, scene: Scene) -> None:
        """Writes the media, and which of them is around the camera."""
        self.medium = scene.medium
        for medium in media_of(scene):
            self.media[medium] = self.label("medium")
            self.lines.append(self.medium_line(medium, self.media[medium]))
        if self.media:
            self.lines += self.around_camera()

    def medium_line(self, medium: Medium, name: str) -> str:
        """The definition of a medium."""
        raise NotImplementedError

    def around_camera(self) -> list[str]:
        """Lines that set the medium around the camera."""
        raise NotImplementedError

    def write_settings(self, scene: Scene) -> None:
        """Writes the integrator, the sampler, the filter and the film."""
        raise NotImplementedError

    def write_camera(self, camera: Camera) -> None:
        """Writes the camera with its placement."""
        raise NotImplementedError

    def write_light(self, light: Light) -> None:
        """Writes a light."""
        raise NotImplementedError

    def write_instance(self, instance: Instance) -> None:
        """Writes a shape, or a reference to an object that was written before, with its placement."""
        raise NotImplementedError

    def part(self, instance: Instance) -> list[str]:
        """Lines of a shape and its material, without its placement."""
        raise NotImplementedError

    def _environment_only_seen(self, scene: Scene) -> None:
        if scene.background is not None:
            self.report.add(scene.name or "scene", "a background that lights nothing", "an infinite light")
            self.write_light(scene.background)
        if scene.ambient != (0.0, 0.0, 0.0):
            self.report.add(scene.name or "scene", "constant ambient light")

    def depth(self, scene: Scene) -> int:
        """Greatest number of bounces; an unlimited one is replaced by a finite one, which is reported."""
        if scene.integrator.depth >= 0:
            return scene.integrator.depth
        self.report.hint("integrator", "paths without a limit", f"{_ENDLESS} bounces")
        return _ENDLESS

    def window(self, half: float, mirrored: bool = False, shift: tuple[float, float] = (0.0, 0.0)) -> str:
        """The screen window of an image whose shorter side is twice ``half`` and whose centre is offset from the axis
        by ``shift``."""
        width, height = (half * side for side in self.aspect)
        width = -width if mirrored else width
        across, up = 2.0 * width * shift[0], 2.0 * height * shift[1]
        return f' "float screenwindow" {listed((across - width, across + width, up - height, up + height))}'

    def camera_line(self, camera: Camera) -> str:
        """The directive of a camera, without its placement."""
        if isinstance(camera, PerspectiveCamera):
            line = f'Camera "perspective" "float fov" [ {number(camera.fov_deg)} ]'
            if camera.lens_radius > 0.0:
                line += f' "float lensradius" [ {number(camera.lens_radius)} ]'
            if camera.focal_distance != FAR:
                line += f' "float focaldistance" [ {number(camera.focal_distance)} ]'
            if camera.shutter_s != (0.0, 0.0):
                line += f' "float shutteropen" [ {number(camera.shutter_s[0])} ]'
                line += f' "float shutterclose" [ {number(camera.shutter_s[1])} ]'
            if camera.shift != (0.0, 0.0):
                line += self.window(1.0, shift=camera.shift)
        elif isinstance(camera, OrthographicCamera):
            line = 'Camera "orthographic"'
            if camera.half_width != 1.0:
                line += self.window(camera.half_width)
        elif isinstance(camera, EnvironmentCamera):
            line = 'Camera "environment"'
        else:
            assert isinstance(camera, RealisticCamera)
            numbers = (
                f'"float aperturediameter" [ {number(camera.aperture_diameter)} ] '
                f'"float focusdistance" [ {number(camera.focus_distance)} ]'
            )
            line = f'Camera "realistic" "string lensfile" [ {quoted(camera.lens_file)} ] {numbers}'
        return line

    def object_line(self, instance: Instance) -> str:
        """The line that places an object; a new object is defined first."""
        key = part_key(instance)
        if key not in self._objects:
            made = self.part(instance)
            label = self.label("o")
            self._objects[key] = label
            lines = [f'\tObjectBegin "{label}"', *(f"\t\t{line}" for line in made), "\tObjectEnd"]
            if borders_media(instance):  # LuxCore's media go on behind the object
                lines = ["\tAttributeBegin", *(f"\t{line}" for line in lines), "\tAttributeEnd"]
            self.lines += lines
        return f'ObjectInstance "{self._objects[key]}"'

    def mesh_line(self, mesh: Mesh, in_file: bool = False) -> str:
        """The directive of a mesh: small meshes are written inline, others to their own file."""
        if len(mesh.faces) > INLINE_MAX or in_file:
            return f'Shape "plymesh" "string filename" [ "{self.output.mesh(mesh)}" ]'
        return f'Shape "trianglemesh" {_inline_mesh(mesh)}'


def _inline_mesh(mesh: Mesh) -> str:
    """Parameters of a mesh."""
    parts = [f'"integer indices" [ {" ".join(map(str, mesh.faces.ravel().tolist()))} ]']
    parts.append(f'"point P" {listed(mesh.vertices.ravel())}')
    if mesh.normals is not None:
        parts.append(f'"normal N" {listed(mesh.normals.ravel())}')
    if mesh.uvs is not None:
        parts.append(f'"float uv" {listed(mesh.uvs.ravel())}')
    return " ".join(parts)


def quoted(text: str) -> str:
    """A quoted string of a directive file; quotes in it are dropped."""
    return '"' + text.replace("\\", "/").replace('"', "") + '"'
