"""Reader of scene files of the motion-blur perception thesis: blocks to the canonical scene.

The clock of a file has its own time unit; a moving object is at ``location + velocity * t``. In the scene, time is in
seconds from the first frame, scaled so that the frames have the file's frame rate.

Source: motion-blur perception thesis, chapter 3, fig. 13. Attributes that the figure does not show (``rotation``,
``spread``, ``aperture`` and others) are listed in :data:`scenes.formats.blocks.text.ALLOWED`.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.animation import LEAD_S, Pose, Times, sample_track
from scenes.arithmetic import product
from scenes.canonical import (
    ConstantTexture,
    Cube,
    DirectionalLight,
    Disk,
    Emissive,
    EnvironmentLight,
    Film,
    Glass,
    ImageTexture,
    Instance,
    Integrator,
    Light,
    Material,
    Matrix,
    Mirror,
    PerspectiveCamera,
    Phong,
    PointLight,
    Rectangle,
    Rgb,
    RigidTrack,
    Scene,
    SceneError,
    Sphere,
    SpotLight,
)
from scenes.formats.blocks.settings import Settings, read_settings
from scenes.formats.blocks.text import Block, read_blocks
from scenes.formats.blocks.transforms import aimed, facing, transform
from scenes.loading import clamp_radiance, read_image
from scenes.models import place_model

_KEYS_PER_FRAME = 4  # keys of a rotating camera
_SHAPES = {"sphere": Sphere, "disk": Disk, "rectangle": Rectangle, "cube": Cube}


def load_blocks(path: Path) -> tuple[Scene, Settings]:
    """A block file as a scene, and the settings of its sequence.

    Files that it names are searched in its folder.

    Raises:
        SceneError: the file, or one that it names, cannot be used; the message gives the place and the expected value.
    """
    path = Path(path)
    blocks = read_blocks(path)
    return _Loader(path.parent, blocks, str(path)).load()


class _Loader:
    """Converts the blocks of one file to a scene."""

    def __init__(self, folder: Path, blocks: list[Block], name: str) -> None:
        self.folder, self.blocks, self.name = folder, blocks, name
        self.settings = read_settings(self._single("settings"), Path(name).stem)
        self.groups = self._named("group", "groupname")
        self.materials = {key: self._material(block) for key, block in self._named("material", "materialname").items()}
        self.objects = self._named("object", "objectname", required=False)

    def load(self) -> tuple[Scene, Settings]:
        """The scene and its settings."""
        instances: list[Instance] = []
        lights: list[Light] = []
        for block in self.blocks:
            if block.kind == "object":
                instances += self._object(block, block)
            elif block.kind == "instance":
                source = self._known(self.objects, block, "objectname")
                instances += self._object(source, block)
            elif block.kind == "light":
                light = self._light(block)
                (instances if isinstance(light, Instance) else lights).append(light)  # type: ignore[arg-type]
        block, settings = self._single("settings"), self.settings
        background = None
        if "envmap" in block.values:
            image = read_image(self.folder / block.require("envmap"))
            if "envmaplimit" in block.values:
                image = clamp_radiance(image, block.get("envmaplimit"))
            background = EnvironmentLight(image, source=block.get("envmap"))
        scene = Scene(
            self._camera(),
            tuple(instances),
            tuple(lights),
            film=Film(settings.width_px, settings.height_px),
            integrator=Integrator("whitted", depth=int(block.get("maxdepth", 4))),
            ambient=block.get("ambientlightcolor", (0.0, 0.0, 0.0)),
            name=settings.name,
            duration_s=settings.frame_count / settings.frame_rate_hz,
            background=background,
        )
        return scene, settings

    def _single(self, kind: str) -> Block:
        found = [block for block in self.blocks if block.kind == kind]
        if len(found) != 1:
            where = found[1].where if found else self.name
            raise SceneError(f"{where}: expected exactly one {kind} block, got {len(found)}")
        return found[0]

    def _named(self, kind: str, key: str, required: bool = True) -> dict[str, Block]:
        named: dict[str, Block] = {}
        for block in self.blocks:
            if block.kind == kind and (required or key in block.values):
                name = block.require(key)
                if name in named:
                    raise SceneError(f"{block.where}: {kind} {name!r} occurs twice")
                named[name] = block
        return named

    def _known(self, named: dict[str, Any], block: Block, key: str) -> Any:
        name = block.require(key)
        if name not in named:
            wanted = ", ".join(named) or "one that the file defines"
            raise SceneError(f"{block.where}: {block.kind}.{key}: expected {wanted}, got {name!r}")
        return named[name]

    def _material(self, block: Block) -> Material:
        kind = block.get("type", "phong")
        color = ConstantTexture(block.get("diffusecolor", (1.0, 1.0, 1.0)))
        spread = block.get("spread", 0.0)
        try:
            if kind == "mirror":
                return Mirror(color, spread)
            if kind == "glass":
                return Glass(transmittance=color, ior=block.get("refractionindex", 1.5), spread_deg=spread)
            if kind == "emissive":
                return Emissive(block.require("emissioncolor"))
            if kind != "phong":
                raise SceneError(f"material.type: expected phong, mirror, glass or emissive, got {kind!r}")
            return self._phong(block, color.value)
        except SceneError as error:
            raise SceneError(f"{block.where}: {str(error).removeprefix(f'{block.where}: ')}") from None

    def _phong(self, block: Block, diffuse: Rgb) -> Phong:
        """A Phong material. Deviation: the weight of the ambient term is the ratio of the means of ambient and diffuse
        colour, because the canonical material has one number for it."""
        ambient = 1.0
        if "ambientcolor" in block.values:
            ambient = float(np.mean(block.get("ambientcolor")) / max(np.mean(diffuse), 1e-6))
        texture = ConstantTexture(diffuse)
        if "texture" in block.values:
            texture = ImageTexture(read_image(self.folder / block.get("texture")), source=block.get("texture"))
        least = block.get("fresnelminimum", 0.0)
        return Phong(
            texture,
            block.get("specularcolor", (0.0, 0.0, 0.0)),
            block.get("specularexponent", 32.0),
            ambient,
            least,
            block.get("fresnelmaximum", least),
            block.get("fresnelexponent", 5.0),
            mirror_spread_deg=block.get("spread", 0.0),
        )

    def _object(self, source: Block, block: Block) -> list[Instance]:
        """Instances of an object, placed by ``block``."""
        kind = source.require("type")
        name = block.get("objectname", f"{kind} of {block.where}")
        matrix, velocity = self._placed(block)
        material = None
        if "materialname" in {**source.values, **block.values}:
            material = self._known(self.materials, block if "materialname" in block.values else source, "materialname")
        track = self._track(velocity)
        if kind == "model":
            path = self.folder / source.require("modelfilename")
            try:
                return list(place_model(path, matrix, track, material, name, source.get("smoothangle", 0.0)))
            except SceneError as error:
                raise SceneError(f"{source.where}: {error}") from None
        if kind not in _SHAPES:
            wanted = ", ".join(("model", *_SHAPES))
            raise SceneError(f"{source.where}: object.type: expected one of {wanted}, got {kind!r}")
        radius = {"radius": source.get("radius", 1.0)} if kind in ("sphere", "disk") else {}
        if material is None:
            source.require("materialname")
            raise AssertionError
        return [Instance(_SHAPES[kind](**radius), material, matrix, track, name)]

    def _placed(self, block: Block) -> tuple[Matrix, NDArray[np.float64]]:
        """Placement at time 0 of the file, and velocity; those of a group are applied outside those of its members."""
        matrix, velocity = transform(block), np.asarray(block.get("velocity", (0.0, 0.0, 0.0)))
        if "groupname" in block.values:
            group = self._known(self.groups, block, "groupname")
            outer = transform(group)
            matrix, velocity = product(outer, matrix), product(outer[:3, :3], velocity)
            velocity = velocity + np.asarray(group.get("velocity", (0.0, 0.0, 0.0)))
        if abs(np.linalg.det(matrix[:3, :3])) == 0.0:
            raise SceneError(f"{block.where}: {block.kind}.scale: expected a transform that can be inverted, got 0")
        return matrix, velocity

    def _track(self, velocity: NDArray[np.float64]) -> RigidTrack | None:
        """Uniform motion over the whole sequence, with two keys."""
        if not velocity.any():
            return None
        settings = self.settings
        ends_s = np.array([-LEAD_S, settings.frame_start_s(settings.frame_count) + LEAD_S])
        translation = np.asarray(settings.file_time(ends_s))[:, None] * velocity
        still = np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))
        return RigidTrack(float(ends_s[0]), float(np.ptp(ends_s)), translation, still)

    def _light(self, block: Block) -> Light | Instance:
        kind, color = block.require("type"), block.get("color", (1.0, 1.0, 1.0))
        if kind == "point":
            return PointLight(block.require("location"), color)
        if kind == "directional":
            return DirectionalLight(block.require("direction"), color, block.get("angle", 0.0))
        if kind == "spot":
            outer = block.get("outerangle", 30.0)
            angles = block.get("innerangle", 0.8 * outer), outer
            return SpotLight(block.require("location"), block.require("target"), color, *angles)
        if kind == "area":
            half_x, half_y = np.asarray(block.require("size")) / 2.0
            matrix = facing(block, np.asarray(block.require("location")), np.asarray(block.require("target")))
            black = Phong(ConstantTexture((0.0, 0.0, 0.0)))
            scaled = product(matrix, np.diag([half_x, half_y, 1.0, 1.0]))
            return Instance(Rectangle(), black, scaled, name=f"light of {block.where}", emission=color)
        if kind == "environment":
            return EnvironmentLight(read_image(self.folder / block.require("map")), source=block.get("map"))
        wanted = "point, directional, spot, area, environment"
        raise SceneError(f"{block.where}: light.type: expected one of {wanted}, got {kind!r}")

    def _camera(self) -> PerspectiveCamera:
        """A camera whose position, target and up vector move uniformly; rotation is sampled four times per frame."""
        block, settings = self._single("camera"), self.settings
        rows = {
            name: (np.asarray(block.get(name, default)), np.asarray(block.get(f"{name}velocity", (0.0, 0.0, 0.0))))
            for name, default in (("location", None), ("lookat", None), ("up", (0.0, 1.0, 0.0)))
            if name in block.values or default is not None or block.require(name)
        }

        def pose(time_s: Times) -> Pose:
            t = np.atleast_1d(settings.file_time(time_s))[:, None]
            eye, target, up = (place + velocity * t for place, velocity in rows.values())
            return eye, aimed(eye, target, up, block)

        shutter = (0.0, settings.shutter_share / settings.frame_rate_hz)
        camera = PerspectiveCamera(
            fov_deg=block.get("fov", 45.0),
            lens_radius=block.get("aperture", 0.0) / 2.0,
            focal_distance=block.get("focaldistance", 1.0),
            shutter_s=shutter,
        )
        end_s = settings.frame_start_s(settings.frame_count) + LEAD_S
        if any(velocity.any() for _, velocity in rows.values()):
            interval_s = 1.0 / (settings.frame_rate_hz * _KEYS_PER_FRAME)
            return dataclasses.replace(camera, track=sample_track(pose, -LEAD_S, end_s, interval_s))
        eye, turn = pose(np.zeros(1))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn.as_matrix()[0], eye[0]
        return dataclasses.replace(camera, to_world=matrix)
