"""Models as scenes for conversion.

Shapes and materials become what scene files have: meshes that are canonical shapes, lamps that emit on their front, and
matte surfaces.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from scenes.arithmetic import product
from scenes.canonical import (
    Emissive,
    Instance,
    Integrator,
    Masked,
    Material,
    Matte,
    Mesh,
    MetallicRough,
    NormalMapped,
    Scene,
)
from scenes.canonical.values import Matrix, Rgb
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.mixtures import BLACK
from scenes.formats.appearance.spectra import rgb
from scenes.formats.geometry.placing import shines
from scenes.formats.geometry.recognition import shape_of
from scenes.formats.losses import LossReport
from scenes.formats.text.format import Format
from scenes.models import MODEL_ENDINGS, read_whole
from scenes.models.scenes_of_models import model_scene

_DEPTH = 16


class _Parts:
    """Converts instances; each mesh with its material, and each material, once."""

    def __init__(self, report: LossReport) -> None:
        self.report = report
        self._materials: dict[int, tuple[Material, Material, Rgb | None]] = {}
        self._shapes: dict[tuple[int, int, bool], tuple[Instance, Instance, Matrix]] = {}

    def instance(self, instance: Instance) -> Instance:
        key = id(instance.shape), id(instance.material), instance.emission_twosided
        if key not in self._shapes:
            material, emission = self._material(instance.material, instance.name)
            shine = instance.emission or emission
            both = shine is not None and instance.emission_twosided
            made = dataclasses.replace(instance, material=material, emission=shine, emission_twosided=both)
            shape, own = made.shape, np.eye(4)
            if isinstance(shape, Mesh):
                shape, own = shape_of(shape, material, instance.name, self.report)
            self._shapes[key] = instance, dataclasses.replace(made, shape=shape), own
        _, made, own = self._shapes[key]
        place = product(instance.to_world, own)
        return dataclasses.replace(made, to_world=place, track=instance.track, name=instance.name)

    def _material(self, material: Material, where: str) -> tuple[Material, Rgb | None]:
        if id(material) not in self._materials:
            self._materials[id(material)] = material, *self._converted(material, where)
        return self._materials[id(material)][1:]

    def _converted(self, material: Material, where: str) -> tuple[Material, Rgb | None]:
        """A material without its light, and the radiance of its front."""
        if isinstance(material, Masked | NormalMapped):
            base, emission = self._converted(material.base, where)
            if isinstance(base, Emissive):  # of both sides, as its shape is
                base, emission = BLACK, base.radiance
            return dataclasses.replace(material, base=base), emission
        if not isinstance(material, MetallicRough):
            return material, None
        emission = None
        if max(material.emission) > 0.0:
            emission = material.emission
            if material.glow is not None:
                self.report.add(where, "a texture of the emission", "its mean")
                emission = rgb([part * mean for part, mean in zip(emission, mean_of(material.glow), strict=True)])
        bare = dataclasses.replace(material, emission=(0.0, 0.0, 0.0), glow=None)
        if bare == MetallicRough(bare.base, 0.0, bare.roughness, ior=1.0):  # its facets reflect nothing
            return Matte(bare.base), emission
        return bare, emission


def load_model(path: Path, root: Path | None, report: LossReport) -> Scene:
    """Reads a model as a scene; without a camera or lights it has those of :func:`scenes.viewing.framed`.

    Surfaces that shine are the lights of a file that has a camera.

    Raises:
        SceneError: the file cannot be read.
    """
    scene, parts = model_scene(path, report, facets=True), _Parts(report)
    instances = tuple(map(parts.instance, scene.instances))
    scene = dataclasses.replace(scene, instances=instances, integrator=Integrator("path", _DEPTH))
    added = scene.background is not None
    if added and any(map(shines, instances)) and read_whole(path, facets=True).cameras:
        scene = dataclasses.replace(scene, lights=(), ambient=(0.0, 0.0, 0.0), background=None)
    return scene


MODEL = Format("a model", MODEL_ENDINGS, load_model)
