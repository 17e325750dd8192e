"""Lines of directives of a whole scene: what PBRT and LuxRender share.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from scenes.canonical import (
    Camera,
    EnvironmentCamera,
    Instance,
    Light,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    RealisticCamera,
    Scene,
)
from scenes.formats.directives.surface_writer import SurfaceWriter
from scenes.formats.geometry.conventions import FAR, aspect_of
from scenes.formats.geometry.placing import PartKey, lose_back, part_key, shared_parts
from scenes.formats.text.numbers import listed, number

INLINE_MAX = 64
"""Triangles of a mesh that is written into the scene file; larger ones get a file of their own."""

_ENDLESS = 1000  # bounces in the place of paths without a limit


@dataclass
class SceneWriter(SurfaceWriter):
    """Lines of a scene, as they are made; a dialect adds its settings, lights and shapes."""

    aspect: tuple[float, float] = (1.0, 1.0)
    shared: frozenset[PartKey] = frozenset()
    _objects: dict[PartKey, str] = field(default_factory=dict)

    def write(self, scene: Scene) -> None:
        """Writes a scene."""
        self.shared = shared_parts(scene)
        self.aspect = aspect_of(scene.film)
        self.write_settings(scene)
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

    def write_settings(self, scene: Scene) -> None:
        """Writes the integrator, the sampler, the filter and the film."""
        raise NotImplementedError

    def write_camera(self, camera: Camera) -> None:
        """Writes the camera in its place."""
        raise NotImplementedError

    def write_light(self, light: Light) -> None:
        """Writes a light."""
        raise NotImplementedError

    def write_instance(self, instance: Instance) -> None:
        """Writes a shape, or the place of an object that was written before."""
        raise NotImplementedError

    def part(self, instance: Instance) -> list[str]:
        """Lines of a shape and what it is made of, without its place."""
        raise NotImplementedError

    def _environment_only_seen(self, scene: Scene) -> None:
        if scene.background is not None:
            self.report.add(scene.name or "scene", "a background that is seen and does not light", "an infinite light")
            self.write_light(scene.background)
        if scene.ambient != (0.0, 0.0, 0.0):
            self.report.add(scene.name or "scene", "constant ambient light")

    def depth(self, scene: Scene) -> int:
        """Greatest number of bounces; a finite one where there is no limit, which is reported."""
        if scene.integrator.depth >= 0:
            return scene.integrator.depth
        self.report.hint("integrator", "paths without a limit", f"{_ENDLESS} bounces")
        return _ENDLESS

    def window(self, half: float, mirrored: bool = False, shift: tuple[float, float] = (0.0, 0.0)) -> str:
        """The screen window of an image whose shorter side is twice ``half``, its middle off the axis by ``shift``."""
        width, height = (half * side for side in self.aspect)
        width = -width if mirrored else width
        across, up = 2.0 * width * shift[0], 2.0 * height * shift[1]
        return f' "float screenwindow" {listed((across - width, across + width, up - height, up + height))}'

    def camera_line(self, camera: Camera) -> str:
        """What a camera is, without its place."""
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
        """The line that places an object; the object is made where it is new."""
        key = part_key(instance)
        if key not in self._objects:
            made = self.part(instance)
            label = self.label("o")
            self._objects[key] = label
            self.lines += [f'\tObjectBegin "{label}"', *(f"\t\t{line}" for line in made), "\tObjectEnd"]
        return f'ObjectInstance "{self._objects[key]}"'

    def mesh_line(self, mesh: Mesh, in_file: bool = False) -> str:
        """A mesh: in the scene file where it is small, else in a file of its own."""
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
    """A string of a file of directives; quotes in it are dropped."""
    return '"' + text.replace("\\", "/").replace('"', "") + '"'
